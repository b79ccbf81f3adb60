// The page of the pictures: takes several, sends them, shows what came back. Drawing is in overlay.js.

import { api } from "./api.js";
import { codeCard, showCode } from "./code_card.js";
import { byId, download, isTyping, onDrop, problemOf, showProblem } from "./dom.js";
import { Film } from "./film.js";
import { t } from "./i18n.js";
import { recipeLink, spaceLink } from "./joblinks.js";
import { instanceAt, labelMap } from "./masks.js";
import { culpritsOf, draw } from "./overlay.js";
import { clearResult, showFiles, showFocus, showResult, showTimings } from "./panels.js";
import { follow, remember } from "./permalink.js";
import { Queue } from "./queue.js";
import { offer } from "./samples.js";
import { shell } from "./shell.js";
import { Stage } from "./stage.js";

const REACH = 6; // screen pixels between the pointer and a cable that still count as on it
const FILES = ["instances", "overlay", "mask"];

const canvas = byId("canvas");
const page = { shown: null, hovered: null, pinned: null, camera: {} };
const stage = new Stage(canvas, (context, view) => paint(context, view, page.shown?.scene));
const beside = new Stage(byId("other"), (context, view) => paint(context, view, page.shown?.other));
const queue = new Queue(analyze, changed, api.cancel);
const film = new Film(byId("film"), show);

// Pictures and their jobs ------------------------------------------------------------------------------------------

const empty = () => ({ result: null, map: null });
const pictureOf = (file) => ({ file, name: file.name, depth: null, bitmap: null, scene: empty(), other: empty(), state: "waiting" });

function choose(files) {
  if (!files.length) return;
  const pictures = files.map(pictureOf);
  film.add(pictures);
  for (const picture of pictures) picture.looking = look(picture);
  show(pictures[0]);
  queue.add(pictures);
}

const partsOf = ({ file, depth }) => ({ image: file, depth });

async function look(picture) {
  picture.bitmap = await api.bitmap(picture.file);
  film.picture(picture);
  if (picture === page.shown) place();
}

async function analyze(picture, signal, onJob) {
  Object.assign(picture, { scene: empty(), other: empty(), request: requestOf(picture) });
  const wanted = [[picture.request, "scene"]];
  if (byId("compare").value) wanted.push([{ ...picture.request, method: byId("compare").value }, "other"]);
  for (const [request, into] of wanted) {
    const job = await api.run({ ...request, files: [] }, partsOf(picture), onJob, signal);
    if (!job.result) throw new Error(t("The job was {state}", { state: t(job.state) }));
    picture[into] = { result: job.result, map: labelMap(job.result), job };
  }
  await picture.looking; // no lines without their picture
}

function changed(picture) {
  film.update(picture);
  if (picture !== page.shown) return;
  const job = picture.scene.job ?? picture.job;
  if (job) remember(picture, job.id);
  showState();
}

function show(picture) {
  Object.assign(page, { shown: picture, hovered: null, pinned: null });
  film.select(picture);
  byId("run").disabled = byId("depth").disabled = !canRun();
  byId("depth").value = "";
  byId("depth-name").value = picture.depth?.name ?? "";
  showRequest();
  showState();
}

function showState() {
  const { shown } = page;
  const busy = shown.state === "waiting" || shown.state === "running";
  byId("progress").hidden = byId("cancel").hidden = !busy;
  if (shown.progress === null || shown.progress === undefined) byId("progress").removeAttribute("value");
  else byId("progress").value = shown.progress;
  byId("drop").setAttribute("aria-busy", busy);
  showProblem(shown.problem ? problemOf(shown.problem, "The service cannot be reached") : null);
  if (shown.state === "cancelled") showProblem({ title: t("The job was cancelled"), detail: "", errors: [] });
  showAnswer();
  place();
}

function showAnswer() {
  const { name, scene, other } = page.shown;
  clearResult();
  byId("worst").hidden = true;
  byId("beside").textContent = other.result ? t("Beside it: {text}", { text: summary(other) }) : "";
  canvas.setAttribute("aria-label", name);
  if (!scene.result) return;
  showResult(scene.result, hover, pin);
  byId("worst").hidden = !culpritsOf(scene.result).length;
  showTimings(scene.job.timings_ms);
  const more = [spaceLink(scene.job), recipeLink(scene.job)];
  showFiles([...(canRun() ? FILES.map((file) => `${file}.png`) : []), "result.json"], save, more);
  canvas.setAttribute("aria-label", `${name}: ${summary(scene)}`);
}

/** A picture that came by its address is the service's, not this page's to send. */
const canRun = () => page.shown.file instanceof Blob;

const summary = ({ result }) =>
  `${result.method}: ${t("{n} instances, {m} crossings", { n: result.instances.length, m: result.crossings.length })}`;

// Request and code -------------------------------------------------------------------------------------------------

/** Of a picture with its depth the request says how the camera sees. */
function requestOf(picture) {
  const request = { kind: "instances", method: byId("method").value, ...(picture?.depth ? page.camera : {}) };
  for (const name of ["model", "effort"]) if (byId(name).value) request[name] = byId(name).value;
  if (byId("threshold").value !== "") request.threshold = byId("threshold").valueAsNumber;
  return request;
}

function showRequest() {
  const name = page.shown?.name ?? "picture.jpg";
  const parts = { image: name, ...(page.shown?.depth ? { depth: page.shown.depth.name } : {}) };
  showCode(requestOf(page.shown), parts, t("Cables"));
}

/** The depth of the picture shown: a map of another one must not come with it. */
function takeDepth(file) {
  page.shown.depth = file ?? null;
  byId("depth-name").value = file?.name ?? "";
  showRequest();
}

/** A camera from a file: its intrinsics as such, or with `T_world_camera` beside them. */
async function takeCamera(file) {
  page.camera = {};
  try {
    const given = file ? JSON.parse(await file.text()) : {};
    const { intrinsics, T_world_camera } = given.intrinsics ? given : { intrinsics: given };
    if (file) page.camera = { intrinsics, ...(T_world_camera ? { T_world_camera } : {}) };
    showProblem(null);
  } catch (error) {
    showProblem(problemOf(error, file.name));
  }
  showRequest();
}

// What is seen -----------------------------------------------------------------------------------------------------

const layers = () => [...byId("layers").querySelectorAll("input:checked")].map(({ name }) => name);

function paint(context, view, scene) {
  if (!scene) return;
  const shown = { ...view, shown: new Set(layers()), focus: page.hovered ?? page.pinned };
  draw(context, scene, { ...shown, opacity: byId("opacity").valueAsNumber, culprits: scene.result ? culpritsOf(scene.result) : [] });
}

function place() {
  const { scene, other, bitmap } = page.shown;
  stage.show(scene.result ?? bitmap, bitmap);
  byId("other").hidden = !other.result;
  if (other.result) beside.show(other.result, bitmap);
}

function redraw() {
  stage.redraw();
  if (page.shown?.other.result) beside.redraw();
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

function underPointer(event) {
  const { map } = page.shown?.scene ?? {};
  const instance = map && instanceAt(map, ...stage.toPicture(event), REACH / stage.view.scale);
  return instance ? { instance } : null;
}

/** Turns to the least certain cable or crossing, and with every further press to the next. */
function showWorst() {
  const { result } = page.shown.scene;
  const culprits = culpritsOf(result);
  const at = culprits.findIndex(({ score, ...focus }) => JSON.stringify(focus) === JSON.stringify(page.pinned));
  const { score, ...focus } = culprits[(at + 1) % culprits.length];
  page.pinned = focus;
  const crossing = result.crossings.find(({ id }) => id === focus.crossing);
  const points = crossing ? [crossing.xy] : result.instances.find(({ id }) => id === focus.instance).centerline_xy;
  const [xs, ys] = [0, 1].map((axis) => points.map((point) => point[axis]));
  const room = 40;
  stage.lookAt([Math.min(...xs) - room, Math.min(...ys) - room], [Math.max(...xs) + room, Math.max(...ys) + room]);
  refocus();
}

// Files ------------------------------------------------------------------------------------------------------------

async function save(name) {
  const { name: picture, scene } = page.shown;
  const json = new Blob([JSON.stringify(scene.result, null, 2)], { type: "application/json" });
  try {
    const blob = name === "result.json" ? json : await made(name);
    download(blob, `${picture.replace(/\.[^.]*$/, "")}.${name}`);
  } catch (error) {
    showProblem(problemOf(error, name));
  }
}

/** Files are made when somebody wants them: the job whose answer is shown was asked for none. */
async function made(name) {
  const request = { ...page.shown.request, files: [name.replace(".png", "")] };
  const job = await api.run(request, partsOf(page.shown), () => {});
  return api.file(job.id, name);
}

// Wiring -----------------------------------------------------------------------------------------------------------

/** A finished job by its address; its picture is the service's, which shows it at most 2048 px wide. */
function opened(job, picture) {
  const shown = { ...pictureOf({ name: job.label ?? job.id }), bitmap: picture, state: "done", progress: 1, restored: true };
  shown.request = { kind: "instances", method: job.result.method };
  shown.scene = { result: job.result, map: labelMap(job.result), job };
  film.add([shown]);
  film.picture(shown);
  show(shown);
}

function offerNetworks(networks) {
  const chosen = byId("model").value; // a look with another key must not forget it
  const choices = networks.filter(({ task }) => task === "foreground");
  const options = choices.map(({ name, version }) => new Option(`${name} ${version}`, name));
  byId("model").replaceChildren(new Option(t("default"), ""), ...options);
  if (choices.some(({ name }) => name === chosen)) byId("model").value = chosen;
}

function listen() {
  byId("file").addEventListener("change", (event) => choose([...event.target.files]));
  byId("depth").addEventListener("change", (event) => takeDepth(event.target.files[0]));
  byId("camera").addEventListener("change", (event) => takeCamera(event.target.files[0]));
  byId("form").addEventListener("submit", (event) => {
    event.preventDefault();
    if (page.shown) queue.add([page.shown]);
  });
  byId("form").addEventListener("input", showRequest);
  byId("cancel").addEventListener("click", () => queue.cancel(page.shown));
  byId("worst").addEventListener("click", showWorst);
  for (const event of ["input", "change"]) byId("layers").addEventListener(event, redraw);
  canvas.addEventListener("pointermove", (event) => stage.busy || hover(underPointer(event)));
  canvas.addEventListener("pointerleave", () => hover(null));
  let pressed = null;
  canvas.addEventListener("pointerdown", ({ clientX, clientY }) => (pressed = [clientX, clientY]));
  canvas.addEventListener("click", (event) => {
    const moved = Math.hypot(event.clientX - (pressed?.[0] ?? 0), event.clientY - (pressed?.[1] ?? 0));
    if (moved < 4) pin(underPointer(event));
  });
  addEventListener("keydown", (event) => {
    if (isTyping(event) || event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key === "f" || event.key === "d") film.step(event.key === "f" ? 1 : -1);
    else if (event.key === "u" && !byId("worst").hidden) showWorst();
  });
  document.addEventListener("networks", (event) => offerNetworks(event.detail));
  onDrop((files) => choose(files));
}

shell(showRequest);
codeCard();
stage.addButtons();
stage.follow(beside);
offer(byId("samples"), "cables", choose);
listen();
showRequest();
follow("instances", opened, (error) => showProblem(problemOf(error)), (picture) => show(picture));
