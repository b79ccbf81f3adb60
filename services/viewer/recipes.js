// The page of the recipes: what is stored, a new version of one, one made of a finished job, and trying it.

import { api } from "./api.js";
import { button, byId, element, problemOf, showProblem } from "./dom.js";
import { jobLink } from "./joblinks.js";
import { t } from "./i18n.js";
import { titleOf } from "./problem_titles.js";
import { shell } from "./shell.js";

const EXAMPLE = { name: t("Cables on the table"), request: { kind: "instances", files: [] } };
let [chosen, tried] = [null, null]; // number and version of the stored recipe in the form
let newest = null; // of the recipes that were put into it
let [waiting, running] = [null, []]; // ends the waiting; jobs on their way

async function list() {
  const recipes = await api.json("v1/recipes");
  byId("count").value = recipes.length;
  byId("recipes").replaceChildren(...(recipes.length ? recipes.map(row) : [emptyRow()]));
  return recipes;
}

function row(recipe) {
  const { number, name, request, camera, version } = recipe;
  const made = element("tr");
  const cells = [number, name, request.kind, camera ?? "–", version].map((value, i) => element("td", i % 4 ? "" : "number", String(value)));
  const last = element("td");
  last.append(button(t("Open"), () => guarded(() => choose(recipe))));
  made.append(...cells, last);
  return made;
}

function emptyRow() {
  const made = element("tr");
  made.append(element("td", "hint", t("none yet: save the one in the form, or make one of a finished job"), { colSpan: 6 }));
  return made;
}

// The form ---------------------------------------------------------------------------------------------------------

function fill({ name, request, camera, output, samples }) {
  const body = { request, ...(camera ? { camera } : {}), ...(output ? { output } : {}), ...(samples?.length ? { samples } : {}) };
  byId("name").value = name;
  byId("body").value = JSON.stringify(body, (_, value) => value ?? undefined, 2);
}

async function choose(recipe) {
  newest = recipe;
  chosen = recipe.number;
  show(recipe);
  const versions = await api.json(`v1/recipes/${recipe.number}/versions`);
  if (newest !== recipe) return;
  byId("versions").hidden = false;
  byId("version").replaceChildren(...versions.map(({ version, name, created_at: at, author }) => {
    const text = [`${version}: ${name}`, new Date(at).toLocaleString(), author].filter(Boolean).join(", ");
    return new Option(text, version);
  }));
  byId("version").onchange = () => show(versions.find(({ version }) => String(version) === byId("version").value));
}

/** A version in the form. What is tried is always what is stored; what is saved is the next version. */
function show(recipe) {
  const { number, version, samples } = recipe;
  tried = version;
  byId("number").value = number;
  byId("source").hidden = true;
  fill(recipe);
  byId("chosen").value = t("recipe {number}, version {version}", { number, version });
  byId("run").disabled = false;
  byId("dry-run").disabled = !samples.length;
  byId("outcomes").replaceChildren();
}

async function save() {
  const body = JSON.stringify({ name: byId("name").value, ...JSON.parse(byId("body").value) });
  const number = byId("number").valueAsNumber;
  const headers = { "Content-Type": "application/json" };
  await choose(await api.json(`v1/recipes/${number}`, { method: "PUT", body, headers }));
  await list();
}

/** The recipe that repeats a finished job, under the next free number. */
async function fromJob(id, recipes) {
  const body = await api.json(`v1/jobs/${encodeURIComponent(id)}/recipe`);
  fill(body);
  byId("number").value = 1 + Math.max(0, ...recipes.map(({ number }) => number));
  byId("source").hidden = false;
  byId("source").textContent = t("Made of the job {id}, with {n} of its pictures to try it. Save it, then try it.", {
    id: id.slice(0, 8), n: body.samples.length,
  });
}

// Trying it --------------------------------------------------------------------------------------------------------

/** `start(signal)` answers the jobs that it began; each is shown until it has ended. */
async function attempt(start) {
  waiting?.abort();
  const { signal } = (waiting = new AbortController());
  byId("outcomes").replaceChildren(element("li", "hint", t("running …")));
  try {
    running = [await start(signal)].flat();
    const lines = running.map(outcome);
    byId("outcomes").replaceChildren(...lines.map(({ line }) => line));
    byId("cancel").hidden = false;
    await Promise.all(running.map((job, i) => api.ended(job, lines[i].show, signal).then(lines[i].show, (error) => lines[i].fail(error))));
  } finally {
    if (waiting.signal === signal) byId("cancel").hidden = true;
  }
}

/** A line that shows how a job goes. */
function outcome(job) {
  const line = element("li");
  const show = (now) => line.replaceChildren(jobLink(now), ` ${t(now.state)} ${summaryOf(now)}`);
  show(job);
  return { line, show, fail: (error) => line.replaceChildren(jobLink(job), ` ${titleOf(problemOf(error))}: ${problemOf(error).detail}`) };
}

function summaryOf({ result, poses }) {
  const found = result?.instances ?? result?.sections;
  const parts = [];
  if (found) parts.push(t("{n} cables", { n: found.length }));
  if (result?.status) parts.push(t((result.status.code ?? result.status).replaceAll("_", " ")));
  if (poses) parts.push(t("{n} poses", { n: poses.poses.length }));
  return parts.length ? `(${parts.join(", ")})` : "";
}

const dryRun = (signal) => api.json(`v1/recipes/${chosen}/dry-run?version=${tried}`, { method: "POST", signal });

function run(signal) {
  const body = new FormData();
  for (const file of byId("pictures").files) body.append("image", file);
  return api.json(`v1/recipes/${chosen}/run?version=${tried}`, { method: "POST", body, signal });
}

function cancel() {
  return Promise.all(running.map(({ id }) => api.cancel(id)));
}

// Wiring -----------------------------------------------------------------------------------------------------------

async function guarded(work) {
  showProblem(null);
  try {
    await work();
  } catch (error) {
    byId("outcomes").replaceChildren();
    showProblem(problemOf(error));
  }
}

async function start() {
  const recipes = await list();
  const asked = new URLSearchParams(location.search);
  if (asked.get("job")) await fromJob(asked.get("job"), recipes);
  else fill(asked.get("body") ? JSON.parse(asked.get("body")) : EXAMPLE);
}

shell(() => guarded(start));
byId("form").addEventListener("submit", (event) => {
  event.preventDefault();
  guarded(save);
});
byId("run").addEventListener("click", () => guarded(() => attempt(run)));
byId("dry-run").addEventListener("click", () => guarded(() => attempt(dryRun)));
byId("cancel").addEventListener("click", () => guarded(cancel));
guarded(start);
