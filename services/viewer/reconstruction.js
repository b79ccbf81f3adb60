// The page of the 3D reconstruction: sends pictures and cameras, or opens a finished job, and shows what came back.

import { api, ProblemError } from "./api.js";
import { codeCard, showCode } from "./code_card.js";
import { byId, element as made, problemOf, showProblem } from "./dom.js";
import { t } from "./i18n.js";
import { recipeLink } from "./joblinks.js";
import { address } from "./permalink.js";
import { shell } from "./shell.js";
import { Space } from "./space.js";

// The target's, then the others' as in overlay_N.png, darker on the light ground.
const COLORS = ["#e0a800", "#40a4d8", "#d85a98", "#4fae4f", "#d8803c", "#9a7fd8", "#0a9a8c", "#c83c32", "#8f9a1e", "#667085", "#8a6242"];
const space = new Space(byId("space"));
let pictures = [];
let cameras = null;
let running = null; // the job on its way
let waiting = null; // ends the waiting for it

async function run(views = cameras, files = pictures) {
  byId("progress").hidden = false;
  byId("progress").removeAttribute("value");
  waiting?.abort();
  const { signal } = (waiting = new AbortController());
  try {
    const request = requestOf(views);
    showRequest(views, files);
    await open(await api.run(request, files, onJob, signal));
  } catch (error) {
    if (!signal.aborted) report(error);
  } finally {
    if (waiting.signal === signal) byId("progress").hidden = byId("cancel").hidden = true;
  }
}

const requestOf = (views) => ({ kind: "reconstruct", method: byId("method").value, views });

/** Pictures that the service knows already are named in the views. */
function showRequest(views = cameras, files = pictures) {
  const image = files.map(({ name }) => name);
  showCode(requestOf(views ?? []), image.length ? { image } : {}, t("Cable in 3D"));
}

function onJob(job) {
  running = job;
  byId("cancel").hidden = false;
  byId("progress").value = job.progress;
}

async function cancel() {
  waiting.abort();
  byId("progress").hidden = byId("cancel").hidden = true;
  await api.cancel(running.id).catch(report);
  showProblem(wrong(t("The job was cancelled")));
}

/** The example of the API's own documentation, whose pictures the service knows. */
async function trySample() {
  const { paths } = await api.json("openapi.json");
  const { examples } = paths["/v1/jobs"].post.requestBody.content["application/json"];
  const { views } = Object.values(examples).find(({ value }) => value.kind === "reconstruct").value;
  await run(views, []);
}

async function open(job) {
  if (job.problem) throw new ProblemError(job.problem);
  if (job.result?.instances?.some(({ curve_m }) => curve_m)) return openMeasured(job);
  if (job.result?.kind !== "reconstruct") throw new ProblemError(wrong(t("Job {id} holds no reconstruction", job)));
  named(job);
  const { result } = job;
  const views = result.views.map((view) => ({ ...view, kind: view.status }));
  const next = (result.next_view?.T_world_camera ?? []).map((pose) => ({
    T_world_camera: pose, intrinsics: views[0].intrinsics, kind: "next",
  }));
  const curves = [result.curve, ...result.others.map(({ curve }) => curve)];
  space.show(curves.map((curve, i) => ({ ...curve, color: COLORS[i % COLORS.length] })), [...views, ...next]);
  const found = t("{cm} cm of cable from {n} views", { cm: (100 * result.curve.length_m).toFixed(1), n: views.length });
  byId("space").setAttribute("aria-label", found);
  showFacts(result);
  byId("after").replaceChildren(recipeLink(job) ?? "");
  await showViews(job, views);
}

function named(job) {
  showProblem(null);
  byId("job").value = job.id;
  if (new URLSearchParams(location.search).get("job") !== job.id) address(`?job=${job.id}`);
}

/** The cables of one picture, as its depth has measured them. */
function openMeasured(job) {
  named(job);
  const measured = job.result.instances.filter(({ curve_m }) => curve_m);
  const curves = measured.map(({ id, curve_m, ...rest }) => ({ ...rest, points_m: curve_m, color: COLORS[(id - 1) % COLORS.length] }));
  space.show(curves, []);
  byId("space").setAttribute("aria-label", t("{n} cables", { n: curves.length }));
  const facts = measured.map(({ id, radius_m, sigma_m }) => [
    t("cable {id}", { id }), radius_m ? `⌀ ${mm(2 * radius_m)}${sigma_m ? `, σ ${mm(mean(sigma_m))}` : ""}` : t("not known"),
  ]);
  byId("facts").replaceChildren(...facts.flatMap(([name, value]) => [element("dt", name), element("dd", value)]));
  byId("warnings").replaceChildren(...(job.result.warnings ?? []).map((text) => element("li", text)));
  byId("after").replaceChildren(recipeLink(job) ?? "");
  byId("views").replaceChildren();
}

const mm = (meters) => `${(1000 * meters).toFixed(2)} mm`;
const mean = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;

function showFacts(result) {
  const { curve, next_view: next } = result;
  const facts = {
    length: `${(1000 * curve.length_m).toFixed(1)} mm`,
    radius: curve.radius_m === null ? t("not known") : mm(curve.radius_m),
    "standard deviation": mm(mean(curve.sigma_m)),
    reprojection: `${result.reprojection_px.toFixed(2)} px`,
    ends: result.ends.map((end) => t(end)).join(", "),
    "other cables": String(result.others.length),
  };
  if (result.overlap !== null) facts["known before"] = `${Math.round(100 * result.overlap)} %`;
  if (next) {
    facts["next baseline"] = mm(next.baseline_m);
    facts["change of distance"] = `${next.delta_z_m > 0 ? "+" : "−"}${mm(Math.abs(next.delta_z_m))}`;
    facts["then expected"] = t("{x} ({n} % less)", { x: mm(next.expected_sigma_m), n: Math.round(100 * next.gain) });
  }
  const entries = Object.entries(facts).flatMap(([name, value]) => [element("dt", t(name)), element("dd", value)]);
  byId("facts").replaceChildren(...entries);
  byId("warnings").replaceChildren(...result.warnings.map((text) => element("li", text)));
}

async function showViews(job, views) {
  const names = new Set(job.files.map(({ name }) => name));
  const items = views.map((view, number) => {
    const item = element("li");
    item.tabIndex = 0;
    item.classList.toggle("dropped", view.status === "dropped");
    const image = element("img");
    image.alt = t("{name} with the reprojected curve", view);
    const error = view.reprojection_px === null ? t(view.status) : `${view.reprojection_px.toFixed(2)} px`;
    item.append(image, element("p", `${view.name}: ${error}`));
    if (view.reason) item.append(Object.assign(element("p", view.reason), { className: "reason" }));
    for (const [event, shown] of [["pointerenter", view], ["focus", view], ["pointerleave", null], ["blur", null]]) {
      item.addEventListener(event, () => {
        space.highlighted = shown;
        space.draw();
      });
    }
    return { item, image, file: `overlay_${number}.png` };
  });
  byId("views").replaceChildren(...items.map(({ item }) => item));
  const shown = items.filter(({ file }) => names.has(file));
  await Promise.all(shown.map(async ({ image, file }) => {
    image.src = URL.createObjectURL(await api.file(job.id, file));
    await image.decode();
    URL.revokeObjectURL(image.src);
  }));
}

async function readCameras(file) {
  cameras = null;
  try {
    const given = JSON.parse(await file.text());
    cameras = Array.isArray(given) ? given : given.views;
    if (!Array.isArray(cameras)) throw new Error(t("it holds no list"));
    cameras = cameras.map(({ image, ...camera }) => camera);
    showProblem(null);
  } catch (error) {
    showProblem(wrong(`${file.name}: ${error.message}`));
  }
  allow();
  showRequest();
}

function allow() {
  byId("run").disabled = !(pictures.length >= 2 && cameras);
}

function report(error) {
  showProblem(problemOf(error, "The service cannot be reached"));
}

const wrong = (title) => ({ title, detail: "", errors: [] });

const element = (tag, text = "") => made(tag, "", text);

function openById(id) {
  api.json(`v1/jobs/${encodeURIComponent(id)}`).then(open).catch(report);
}

function listen() {
  byId("files").addEventListener("change", (event) => {
    pictures = [...event.target.files];
    allow();
    showRequest();
  });
  byId("cameras").addEventListener("change", (event) => event.target.files[0] && readCameras(event.target.files[0]));
  byId("form").addEventListener("submit", (event) => {
    event.preventDefault();
    run();
  });
  byId("sample").addEventListener("click", () => trySample().catch(report));
  byId("method").addEventListener("input", () => showRequest());
  byId("cancel").addEventListener("click", cancel);
  byId("job").addEventListener("change", (event) => event.target.value && openById(event.target.value.trim()));
  byId("layers").addEventListener("change", () => {
    space.shown = new Set([...byId("layers").querySelectorAll("input:checked")].map(({ name }) => name));
    space.enlarged = Number(byId("enlarged").value);
    space.draw();
  });
  byId("top").addEventListener("click", () => space.look(0, Math.PI / 2));
  byId("side").addEventListener("click", () => space.look(0, 0));
}

function openAsked() {
  const asked = new URLSearchParams(location.search).get("job");
  if (asked) openById(asked);
}

shell(() => showRequest());
codeCard();
showRequest();
listen();
openAsked();
addEventListener("popstate", openAsked);
