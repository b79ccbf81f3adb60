// The page of the label bench: opens pictures and labels, shows one, lists all. Tools are in bench_tools.js.

import { api } from "./api.js";
import { Bench, stateOf } from "./bench.js";
import { ask } from "./bench_calls.js";
import { drawBench, drawGround } from "./bench_draw.js";
import { keysOf } from "./bench_keys.js";
import { fillLists, showSaved } from "./bench_lists.js";
import * as disk from "./bench_disk.js";
import { exported, folders, pictureOf, picturesOf, unsurePicture, unsurePictures, yolo } from "./bench_service.js";
import { labelFor, listed, sorted } from "./bench_sources.js";
import { placeOf, Sync } from "./bench_sync.js";
import { Tint } from "./bench_tint.js";
import { Tools } from "./bench_tools.js";
import { byId, download, onDrop, problemOf, showProblem } from "./dom.js";
import { t } from "./i18n.js";
import { coco, jsonLines } from "./label_save.js";
import { Queue } from "./queue.js";
import { offer } from "./samples.js";
import { shell } from "./shell.js";
import { Stage } from "./stage.js";

const HINTS = {
  add: "Click the ends of a cable, and between them where the line would leave it; Enter or a double click ends it, Backspace takes a click back.",
  move: "Drag a line to where the cable is, its end to where that ends, or an edge; with Shift both edges, with Ctrl the same all along the cable.",
  split: "Click where one cable should become two.",
  join: "Click two cables one after the other.",
  delete: "Click a cable, an area or a branch-point to remove it.",
  swap: "Click a crossing to put the other cable on top.",
  ignore: "Click the corners of an area that nobody should learn from; Enter closes it.",
  connector: "Drag a box around a connector.",
  branch: "Click where cables of a harness branch.",
  pan: "Drag the picture. With any tool: the middle button, two fingers or the arrow keys move it, the wheel zooms.",
};

const TWO_FINGERS_MS = 400; // between the first and the second that zoom

const canvas = byId("canvas");
const ground = { of: () => Object.values(grounded()), paint: (context, view) => drawGround(context, grounded(), view) };
const stage = new Stage(canvas, paint, () => tools.tool === "pan" || keys.held.has(" "), ground);
const bench = new Bench(list, (picture) => sync.soon(picture), () => showSaved(bench, sync.state), report);
const sync = new Sync(bench, { conflict, changed: list, failed: report });
const tools = new Tools(bench, stage, () => stage.later(), report);
const tint = new Tint(() => stage.later());
const queue = new Queue(analyze, list, api.cancel);
const keys = keysOf({ tools, bench, step, confirm, save });
let mask = null; // of the picture shown: what the network sees
let decoded = { picture: null, bitmap: null }; // the newest, a promise
let openings = 0; // of pictures so far
let known = { view: null, mask: null }; // picture and size, and probability, that the worker has

// Opening ----------------------------------------------------------------------------------------------------------

const open = (files) => opened(() => listed(files));

/** What `list()` gives, `{ path, blob() }`; labels are saved in the folder `root`, if there is one. */
async function opened(list, root = null) {
  await restored; // it would take the place of what is opened before
  showProblem(null);
  try {
    const { pictures, labels, refused } = await sorted(await list());
    if (refused.length) notice(t("No labels: {names}", { names: refused.slice(0, 3).join(", ") }));
    const paths = pictures.map(({ path }) => path);
    for (const [index, { path, blob }] of pictures.entries()) {
      byId("hint").textContent = t("{name}: reading {n} of {m} …", { name: path, n: index + 1, m: pictures.length });
      await take(path, await blob(), labels, paths, root);
    }
    const lost = labels.filter(({ used }) => !used).length;
    if (lost) notice(t("{n} labels have no picture here with the same bytes", { n: lost }));
  } catch (error) {
    report(error);
  }
  byId("hint").textContent = t(HINTS[tools.tool]);
}

async function take(path, blob, labels, paths, root = null) {
  const file = new File([blob], path.split("/").at(-1), { type: blob.type });
  const sha256 = await api.digest(file);
  const found = labelFor(labels, { sha256, path }, paths);
  for (const other of labels) if (found && other.label.name === found.label.name) other.used = true;
  const known = bench.pictures.length;
  const place = root ? { disk: root, name: found?.label.name ?? path } : { name: path };
  const picture = bench.add({ ...place, sha256, file, confirmed: found?.confirmed }, found?.label);
  if (bench.pictures.length === known) notice(t("{name} is here already, with the same bytes", { name: path }));
  else if (!found) queue.add([picture]);
  if (!bench.shown) await show(picture);
}

async function analyze(picture, signal, onJob) {
  const job = await api.run({ kind: "instances", files: ["mask"] }, picture.file, onJob, signal);
  const { width, height, instances, crossings, method, threshold, models } = job.result;
  const label = { format: "dlo-label/1", width, height, instances, crossings, origin: "service", method, threshold, models };
  bench.note(picture, { mask: await api.file(job.id, "mask.png") });
  if (!bench.begin(picture, label)) notice(t("{name}: drawn before the service answered, so its cables were left out", picture));
  if (picture === bench.shown) await show(picture);
}

/** Of a preview the size is known only when the service has answered. */
const viewOf = (picture) => `${picture.key} ${bench.label(picture)?.width} ${bench.label(picture)?.height}`;

async function openFolder(folder) {
  if (!folder) return;
  for (const { name, sha256, state, certainty } of await picturesOf(folder)) {
    bench.add({ name, sha256, folder, certainty, confirmed: state === "confirmed" });
  }
  if (!bench.shown && bench.pictures.length) await show(bench.pictures[0]);
}

async function openDisk() {
  const found = await disk.chosen();
  if (!found) return;
  await opened(async () => found.entries, found.root);
  await offerDisk();
  sync.rest();
}

/** After a reload the browser asks again before a page may save in a folder, and only when somebody clicks. */
async function offerDisk() {
  const roots = new Map(bench.pictures.filter((picture) => picture.disk).map((picture) => [picture.disk.name, picture.disk]));
  let closed = null;
  for (const root of roots.values()) if (!(await disk.allowed(root))) closed ??= root;
  byId("reopen").hidden = !closed;
  if (!closed) return;
  byId("reopen").textContent = t("Go on saving in {name}", closed);
  byId("reopen").onclick = () => disk.allow(closed).then(offerDisk).then(() => sync.rest()).catch(report);
}

async function openUnsure() {
  for (const { id } of await unsurePictures()) {
    const file = await unsurePicture(id);
    await take(file.name, file, [], [file.name]);
  }
}

/** Shows a picture: its pixels at once, its label as soon as it is here. What is open already is not opened again. */
async function show(picture) {
  if (!picture) return;
  if (bench.shown !== picture) mask = null;
  bench.shown = picture;
  const opening = (openings += 1);
  tools.opens(true);
  tools.resume();
  list();
  try {
    const file = picture.file ?? (await pictureOf(picture.folder, picture.name));
    if (decoded.picture !== picture) decoded = { picture, bitmap: api.bitmap(file) };
    const bitmap = await decoded.bitmap;
    if (!bitmap) throw new Error(t("{name} cannot be shown here", picture));
    await bench.load(picture);
    if (placeOf(picture) && picture.at === 0 && picture.synced !== false) await fetchLabel(picture);
    if (!bench.label(picture)) bench.blank(picture, bitmap);
    if (bench.shown !== picture) return;
    const size = bench.label(picture);
    stage.show(size, bitmap);
    canvas.setAttribute("aria-label", picture.name);
    if (known.view !== viewOf(picture)) {
      known = { view: viewOf(picture), mask: null };
      await ask("open", { bitmap, size });
    }
    await showMask(picture, file);
  } catch (error) {
    decoded = known = {};
    report(error);
  } finally {
    if (opening === openings) tools.opens(false);
  }
  list();
}

async function fetchLabel(picture) {
  if (picture.disk && !(await disk.allowed(picture.disk))) return;
  const { kind, at } = placeOf(picture);
  const { label, etag } = await kind.labelOf(at, picture.name, picture.sha256);
  bench.note(picture, { etag });
  if (label) bench.begin(picture, label, label.origin === "corrected");
}

/** The network's probability, by which lines snap better than by color alone. */
async function showMask(picture, file) {
  if (!picture.mask && picture.seen) {
    if (bench.shown === picture) tools.opens(false); // nobody has to wait for it
    const job = await api.run({ kind: "segment" }, file, () => {}).catch(() => null);
    if (job) bench.note(picture, { mask: await api.file(job.id, "mask.png") });
  }
  if (!picture.mask || bench.shown !== picture || known.mask === picture.mask) return;
  known.mask = picture.mask;
  mask = await createImageBitmap(picture.mask);
  await ask("probability", { bitmap: mask });
  stage.later();
}

// What is seen -----------------------------------------------------------------------------------------------------

const shown = () => ({ probability: byId("probability").checked, hidden: byId("hide").checked });
const opacity = () => byId("opacity").valueAsNumber;

/** What the masks and the probability are drawn from, as values that can be compared. */
function grounded() {
  const label = bench.label();
  return { width: label?.width, height: label?.height, mask, masks: label && tint.of(label), opacity: opacity(), ...shown() };
}

function paint(context, view) {
  drawBench(context, { ...drawnOf(tools), label: bench.label(), opacity: opacity(), shows: shown() }, view);
}

const drawnOf = ({ hovered, chosen, drag, pointer, clicks, trace, ahead, tool }) => ({
  hovered, chosen, drag, pointer, clicks, trace, ahead, tool,
});

function list() {
  const choose = (what) => {
    tools.chosen = what;
    list();
  };
  const hover = (what) => {
    tools.hovered = what;
    stage.later();
  };
  fillLists({ bench, chosen: tools.chosen, saving: sync.state, show, choose, hover });
  stage.later();
}

/** Over the picture's corner and not above it: the picture must not move under somebody's pointer. */
function notice(text) {
  byId("notice").parentElement.hidden = !text;
  byId("notice").textContent = text;
}

function report(error) {
  showProblem(problemOf(error));
}

// Going on, and taking out -----------------------------------------------------------------------------------------

async function step(by) {
  await tools.settled();
  await show(bench.pictures[bench.pictures.indexOf(bench.shown) + by]);
}

/** Confirms the picture, or takes that back. */
async function confirm(goOn) {
  tools.finish();
  await tools.settled();
  if (!bench.label()) return;
  const before = bench.shown;
  bench.confirm(before, goOn ? true : !before.confirmed);
  const next = bench.pictures.find((picture) => stateOf(picture) !== "confirmed");
  if (goOn && next) await show(next);
}

async function save() {
  await tools.settled();
  const labels = await bench.finished();
  const open = bench.pictures.filter((picture) => stateOf(picture) === "changed").length;
  notice(open ? t("{n} changed pictures are not confirmed: they are no corrections yet", { n: open }) : "");
  const format = byId("format").value;
  const own = { json: ["labels.jsonl", jsonLines], coco: ["coco.json", coco] }[format];
  if (own) download(new Blob([own[1](labels)], { type: "application/json" }), own[0]);
  else if (format === "yolo") download(await yolo(jsonLines(labels), bench.pictures), "labels-yolo.zip");
  else download(await exported(format, jsonLines(labels)), `labels-${format}.zip`);
}

async function clear() {
  const own = (picture) => !placeOf(picture) || picture.synced === false;
  const unsaved = bench.pictures.filter((picture) => own(picture) && stateOf(picture) !== "new").length;
  if (unsaved && !window.confirm(t("{n} pictures have changes that are only in this browser. Remove them?", { n: unsaved }))) return;
  bench.pictures.forEach((picture) => queue.cancel(picture));
  await bench.remove([...bench.pictures]);
  stage.show(null, null);
  list();
}

function conflict(picture) {
  const text = t("{name} was changed by somebody else meanwhile. OK keeps your label and replaces theirs; Cancel takes theirs.", picture);
  return window.confirm(text) ? "mine" : "theirs";
}

// Wiring -----------------------------------------------------------------------------------------------------------

/** Two tabs would each keep its own steps of the same pictures. */
function warnOfSecondTab() {
  navigator.locks?.request("dlo-label-bench", { ifAvailable: true }, (lock) => {
    if (lock) return new Promise(() => {});
    notice(t("The bench is open in another tab too: work in one of them only"));
    return null;
  });
}

async function offerFolders() {
  const names = await folders();
  byId("folders").hidden = !names.length;
  byId("folder").replaceChildren(new Option(t("choose"), ""), ...names.map((name) => new Option(name, name)));
  byId("unsure").hidden = !(await unsurePictures()).length;
  const asked = new URLSearchParams(location.search).get("folder");
  if (names.includes(asked)) {
    byId("folder").value = asked;
    await openFolder(asked);
  }
}

function listen() {
  addEventListener("beforeunload", (event) => bench.unkept && event.preventDefault());
  byId("file").addEventListener("change", (event) => open([...event.target.files]));
  byId("directory").addEventListener("change", (event) => open([...event.target.files]));
  byId("disk").addEventListener("click", () => openDisk().catch(report));
  byId(disk.canWrite() ? "disk" : "no-disk").hidden = false;
  byId("folder").addEventListener("change", (event) => openFolder(event.target.value).catch(report));
  byId("unsure").addEventListener("click", () => openUnsure().catch(report));
  byId("undo").addEventListener("click", () => bench.go(-1));
  byId("redo").addEventListener("click", () => bench.go(1));
  byId("confirm").addEventListener("click", () => confirm(false));
  byId("previous").addEventListener("click", () => step(-1));
  byId("following").addEventListener("click", () => step(1));
  byId("save").addEventListener("click", () => save().catch(report));
  byId("dismiss").addEventListener("click", () => notice(""));
  byId("clear").addEventListener("click", () => clear().catch(report));
  byId("tools").addEventListener("input", ({ target }) => {
    if (target.name === "tool") {
      tools.take(target.value);
      byId("hint").textContent = t(HINTS[target.value]);
      byId("drop").dataset.tool = target.value;
    }
    tools.snaps = byId("snap").checked;
    stage.later();
  });
  let touched = -Infinity;
  canvas.addEventListener("pointerdown", (event) => {
    if (stage.busy && event.timeStamp - touched < TWO_FINGERS_MS) tools.undoTouch();
    else if (!stage.busy && !event.button) tools.press(event);
    if (event.pointerType === "touch") touched = stage.busy ? -Infinity : event.timeStamp;
    if (tools.drag) canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener("pointermove", (event) => stage.busy || tools.move(event));
  canvas.addEventListener("pointerup", (event) => tools.release(event));
  canvas.addEventListener("pointerleave", () => tools.leave());
  canvas.addEventListener("dblclick", () => {
    if (tools.tool !== "add" && tools.tool !== "ignore") return;
    tools.back(); // the second click of the two
    tools.finish();
  });
  onDrop((files) => open(files));
}

shell(offerFolders);
stage.addButtons();
offer(byId("samples"), "cables", open);
listen();
warnOfSecondTab();
byId("hint").textContent = t(HINTS.add);
const restored = bench.restore().catch(report);
await restored;
await show(bench.pictures.find((picture) => stateOf(picture) !== "confirmed") ?? bench.pictures[0]);
queue.add(bench.pictures.filter(({ file, seen, at }) => file && !seen && at === 0));
await offerFolders();
await offerDisk();
sync.rest();
document.body.dataset.ready = "yes";
