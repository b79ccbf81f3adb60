// The page: picks a picture, sends it, shows what came back. State is in `page`; drawing is in overlay.js.

import { Api, ProblemError } from "./api.js";
import { instanceAt, labelMap } from "./masks.js";
import { draw, erase } from "./overlay.js";
import { byId, clearResult, showFiles, showFocus, showProblem, showResult, showTimings } from "./panels.js";
import { curlOf, pythonOf } from "./snippets.js";

const REACH = 6; // screen pixels between the pointer and a cable that still count as on it
const LARGEST_SIDE = 8192; // device pixels a canvas may have in one direction
const FILES = ["instances", "overlay", "mask"];
const TALLEST = 0.72; // of the window, for a picture that is fitted

const api = new Api();
const canvas = byId("canvas");
const context = canvas.getContext("2d");
const page = {
  file: null,
  request: null, // the one whose answer is shown
  scene: { bitmap: null, result: null, map: null },
  job: null,
  running: null, // the AbortController of the request on its way
  hovered: null,
  pinned: null,
};

async function choose(file) {
  if (!file) return;
  page.running?.abort();
  page.file = file;
  page.scene = { bitmap: null, result: null, map: null };
  forgetResult();
  showRequest();
  byId("run").disabled = false;
  canvas.setAttribute("aria-label", file.name);
  const bitmap = await api.bitmap(file);
  if (page.file !== file) return; // another one was chosen meanwhile
  page.scene.bitmap = bitmap;
  redraw();
  await run();
}

async function run() {
  const controller = new AbortController();
  page.running?.abort();
  page.running = controller;
  page.job = null;
  showProblem(null);
  showBusy(true);
  try {
    page.request = requestOf();
    finish(await api.run({ ...page.request, files: [] }, page.file, follow, controller.signal));
  } catch (error) {
    if (controller.signal.aborted) return;
    report(error);
  } finally {
    if (page.running === controller) showBusy(false);
  }
}

function follow(job) {
  page.job = job;
  byId("progress").value = job.progress;
  byId("cancel").hidden = false;
}

function finish(job) {
  page.job = job;
  forgetResult();
  if (!job.result) return report(new ProblemError({ title: `The job was ${job.state}`, detail: "", errors: [] }));
  page.scene.result = job.result;
  page.scene.map = labelMap(job.result);
  showResult(job.result, hover, pin);
  showTimings(job.timings_ms);
  showFiles([...FILES.map((name) => `${name}.png`), "result.json"], save);
  const found = `${job.result.instances.length} instances, ${job.result.crossings.length} crossings`;
  canvas.setAttribute("aria-label", `${page.file.name}: ${found}`);
  redraw();
}

function report(error) {
  forgetResult();
  showProblem(error.problem ?? { title: "The service cannot be reached", detail: error.message, errors: [] });
}

function forgetResult() {
  Object.assign(page.scene, { result: null, map: null });
  Object.assign(page, { hovered: null, pinned: null });
  showProblem(null);
  clearResult();
  redraw();
}

function showBusy(busy) {
  byId("progress").hidden = !busy;
  byId("progress").removeAttribute("value");
  if (!busy) byId("cancel").hidden = true;
  byId("drop").setAttribute("aria-busy", busy);
}

function requestOf() {
  const request = { kind: "instances", method: byId("method").value };
  if (byId("model").value) request.model = byId("model").value;
  if (byId("threshold").value !== "") request.threshold = byId("threshold").valueAsNumber;
  return request;
}

function showRequest() {
  const base = new URL(".", document.baseURI).href.replace(/\/$/, "");
  const name = page.file?.name ?? "picture.jpg";
  byId("curl").textContent = curlOf(requestOf(), name, base, Boolean(api.key));
  byId("python").textContent = pythonOf(requestOf(), name, base);
}

function hover(focus) {
  if (JSON.stringify(focus) === JSON.stringify(page.hovered)) return;
  page.hovered = focus;
  refocus();
}

function pin(focus) {
  page.pinned = JSON.stringify(focus) === JSON.stringify(page.pinned) ? null : focus;
  refocus();
}

function refocus() {
  showFocus(page.hovered, page.pinned);
  redraw();
}

const layers = () => [...byId("layers").querySelectorAll("input:checked")].map(({ name }) => name);

function pictureSize() {
  const { bitmap, result } = page.scene;
  return result ?? bitmap ?? { width: 0, height: 0 };
}

function scaleOf({ width, height }) {
  const fitted = Math.min(byId("drop").clientWidth / width, (TALLEST * innerHeight) / height);
  const wanted = layers().includes("actual") ? 1 : fitted;
  return Math.min(wanted, LARGEST_SIDE / devicePixelRatio / Math.max(width, height));
}

function redraw() {
  const size = pictureSize();
  byId("drop").classList.toggle("empty", !size.width);
  if (!size.width) return erase(canvas);
  const scale = scaleOf(size);
  canvas.style.width = `${size.width * scale}px`;
  canvas.style.height = `${size.height * scale}px`;
  canvas.width = Math.max(1, Math.round(size.width * scale * devicePixelRatio));
  canvas.height = Math.max(1, Math.round(size.height * scale * devicePixelRatio));
  const focus = page.hovered ?? page.pinned;
  draw(context, page.scene, { scale, density: devicePixelRatio, shown: new Set(layers()), focus });
}

function underPointer(event) {
  if (!page.scene.map) return null;
  const scale = scaleOf(pictureSize());
  const [x, y] = [event.offsetX / scale - 0.5, event.offsetY / scale - 0.5];
  const instance = instanceAt(page.scene.map, x, y, REACH / scale);
  return instance ? { instance } : null;
}

async function save(name) {
  const json = new Blob([JSON.stringify(page.job.result, null, 2)], { type: "application/json" });
  try {
    download(name === "result.json" ? json : await made(name), name);
  } catch (error) {
    showProblem(error.problem ?? { title: name, detail: error.message, errors: [] });
  }
}

/** Files are made when somebody wants them: the job whose answer is shown was asked for none. */
async function made(name) {
  const request = { ...page.request, files: [name.replace(".png", "")] };
  const job = await api.run(request, page.file, () => {});
  return api.file(job.id, name);
}

function download(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = `${page.file.name.replace(/\.[^.]*$/, "")}.${name}`;
  link.click();
  URL.revokeObjectURL(link.href);
}

/** Over plain HTTP from another machine a page has no clipboard: then the text is selected instead. */
async function copy(button) {
  const source = byId(button.dataset.copy);
  try {
    await navigator.clipboard.writeText(source.textContent);
    button.textContent = "Copied";
  } catch {
    getSelection().selectAllChildren(source);
    button.textContent = "Selected";
  }
  setTimeout(() => (button.textContent = "Copy"), 1500);
}

async function greet() {
  const pill = byId("service");
  try {
    const networks = await api.networks();
    const choices = networks.filter(({ task }) => task === "foreground");
    const options = choices.map(({ name, version }) => new Option(`${name} ${version}`, name));
    const chosen = byId("model").value; // a look with another key must not forget it
    byId("model").replaceChildren(new Option("default", ""), ...options);
    if (choices.some(({ name }) => name === chosen)) byId("model").value = chosen;
    pill.textContent = networks.length ? "ready" : "no worker yet";
    pill.className = networks.length ? "pill good" : "pill";
  } catch (error) {
    pill.textContent = error.problem?.status === 401 ? "needs an API key" : "not reachable";
    pill.className = "pill bad";
  }
}

function listen() {
  byId("file").addEventListener("change", (event) => choose(event.target.files[0]));
  byId("form").addEventListener("submit", (event) => {
    event.preventDefault();
    run();
  });
  byId("form").addEventListener("input", showRequest);
  byId("key").addEventListener("change", (event) => {
    api.key = event.target.value.trim();
    showRequest();
    greet();
  });
  byId("cancel").addEventListener("click", () => api.cancel(page.job.id).catch(report));
  byId("layers").addEventListener("change", redraw);
  canvas.addEventListener("pointermove", (event) => hover(underPointer(event)));
  canvas.addEventListener("pointerleave", () => hover(null));
  canvas.addEventListener("click", (event) => pin(underPointer(event)));
  for (const button of document.querySelectorAll("[data-copy]")) {
    button.addEventListener("click", () => copy(button));
  }
  addEventListener("resize", redraw);
  addEventListener("dragover", (event) => event.preventDefault());
  addEventListener("drop", (event) => {
    event.preventDefault();
    byId("file").files = event.dataTransfer.files;
    choose(event.dataTransfer.files[0]);
  });
}

listen();
showRequest();
greet();
