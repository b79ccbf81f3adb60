// The page of the recipes: what is stored, a new version of one, and a run with pictures.

import { api } from "./api.js";
import { button, byId, element, problemOf, showProblem } from "./dom.js";
import { jobLink } from "./joblinks.js";
import { t } from "./i18n.js";
import { shell } from "./shell.js";

const EXAMPLE = { name: "Cables on the table", request: { kind: "instances", files: [] } };
let [chosen, running] = [null, null]; // a recipe's number; the job on its way

async function list() {
  try {
    const recipes = await api.json("v1/recipes");
    byId("count").value = recipes.length;
    byId("recipes").replaceChildren(...recipes.map(row));
    byId("notice").hidden = true;
  } catch (error) {
    const missing = error.problem?.status === 404 || error.problem?.status === 405;
    if (!missing) return showProblem(problemOf(error));
    byId("notice").hidden = false;
    byId("notice").textContent = t("This service has no recipes yet.");
  }
}

function row({ number, name, request, camera, version, output }) {
  const made = element("tr");
  const body = { name, request, ...(camera ? { camera } : {}), ...(output ? { output } : {}) };
  const edit = button(t("Open"), () => choose(number, version, body));
  const cells = [number, name, request.kind, camera ?? "–", version].map((value, i) => element("td", i % 4 ? "" : "number", String(value)));
  const last = element("td");
  last.append(edit);
  made.append(...cells, last);
  return made;
}

function choose(number, version, body) {
  chosen = number;
  byId("number").value = number;
  byId("body").value = JSON.stringify(body, null, 2);
  byId("chosen").value = t("recipe {number}, version {version}", { number, version });
  byId("run").disabled = false;
}

async function save() {
  showProblem(null);
  try {
    const body = JSON.stringify(JSON.parse(byId("body").value));
    const number = byId("number").valueAsNumber;
    const saved = await api.json(`v1/recipes/${number}`, { method: "PUT", body, headers: { "Content-Type": "application/json" } });
    choose(number, saved.version, JSON.parse(body));
    await list();
  } catch (error) {
    showProblem(problemOf(error));
  }
}

async function run() {
  showProblem(null);
  byId("outcome").textContent = t("running …");
  const body = new FormData();
  for (const file of byId("pictures").files) body.append("image", file);
  try {
    let job = await api.json(`v1/recipes/${chosen}/run?wait=1`, { method: "POST", body });
    job = await api.ended(job, ({ id }) => {
      running = id;
      byId("cancel").hidden = false;
    });
    byId("outcome").replaceChildren(`${t(job.state)}: `, jobLink(job));
  } catch (error) {
    byId("outcome").textContent = "";
    showProblem(problemOf(error));
  }
  byId("cancel").hidden = true;
}

shell(list);
const asked = new URLSearchParams(location.search).get("body");
byId("body").value = asked ? JSON.stringify(JSON.parse(asked), null, 2) : JSON.stringify(EXAMPLE, null, 2);
byId("form").addEventListener("submit", (event) => {
  event.preventDefault();
  save();
});
byId("run").addEventListener("click", run);
byId("cancel").addEventListener("click", () => api.cancel(running).catch((error) => showProblem(problemOf(error))));
list();
