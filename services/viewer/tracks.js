// The page of the tracks: frames of a film go to a tracking session one after the other; the answer is a film with ids.

import { api } from "./api.js";
import { color, inkOn } from "./colors.js";
import { byId, download, element, onDrop, problemOf, showProblem } from "./dom.js";
import { framesOf, panned } from "./frames.js";
import { t } from "./i18n.js";
import { offer } from "./samples.js";
import { shell } from "./shell.js";
import { Stage } from "./stage.js";
import { pointAt } from "./strands.js";
import { swatch } from "./swatches.js";

const FRAME_MS = 120;
const page = { work: null, frames: [], results: [], at: 0, stop: null, focus: null, bitmap: null, playing: false };
const stage = new Stage(byId("canvas"), paint);

async function choose(files) {
  if (!files.length) return;
  page.stop?.abort();
  Object.assign(page, { frames: [], results: [], at: 0, stop: null });
  byId("run").disabled = true; // until a film has its frames
  await guarded(async (isLast) => {
    const frames = await framesOf(files, byId("rate").valueAsNumber || 5, (...of) => isLast() && progress(...of));
    if (!isLast()) return; // another film was chosen meanwhile
    page.frames = frames;
    byId("run").disabled = false;
    await show(0);
  });
}

/** What work is done last has the progress and the problem; what began before it ends in silence. */
async function guarded(work) {
  const mine = (page.work = {});
  const isLast = () => page.work === mine;
  showProblem(null);
  byId("progress").hidden = false;
  byId("progress").removeAttribute("value");
  try {
    await work(isLast);
  } catch (error) {
    if (isLast() && !page.stop?.signal.aborted) report(error);
  } finally {
    if (isLast()) byId("progress").hidden = byId("cancel").hidden = true;
  }
}

function report(error) {
  const missing = error.problem?.status === 404 || error.problem?.status === 405;
  showProblem(missing ? { title: t("This service does not track yet"), detail: t("It has no /v1/tracks."), errors: [] } : problemOf(error));
}

async function run() {
  page.stop?.abort();
  const { signal } = (page.stop = new AbortController());
  page.results = [];
  byId("cancel").hidden = false;
  const { id } = await api.json("v1/tracks", {
    method: "POST", signal, body: "{}", headers: { "Content-Type": "application/json" },
  });
  try {
    for (const [k, { blob, time_s: time }] of page.frames.entries()) {
      page.results[k] = await api.json(`v1/tracks/${id}/frames?time_s=${time}`, { method: "POST", body: blob, signal });
      progress(k + 1, page.frames.length);
      await show(k);
    }
  } finally {
    api.fetch(`v1/tracks/${id}`, { method: "DELETE" }).catch(() => {}); // it ends by itself as well
  }
}

function progress(done, all) {
  byId("progress").value = done / all;
}

/** A film that `dlo track` wrote; its pictures are those chosen, if any. */
async function openTrack(file) {
  const lines = (await file.text()).split("\n").filter((line) => line.trim());
  page.results = lines.map((line) => JSON.parse(line));
  await show(0);
}

async function show(index) {
  page.at = index;
  const frame = page.frames[index];
  const length = Math.max(page.frames.length, page.results.length);
  const bitmap = frame ? await api.bitmap(frame.blob) : page.bitmap;
  if (page.at !== index || page.frames[index] !== frame) return; // another one is asked for by now
  page.bitmap = bitmap;
  const result = page.results[index];
  byId("frame").max = Math.max(0, length - 1);
  byId("frame").value = index;
  byId("frame").disabled = byId("play").disabled = length < 2;
  byId("at").value = length ? `${index + 1} / ${length}` : "–";
  byId("save").disabled = !page.results.length;
  stage.show(page.bitmap ?? sizeOf(result), page.bitmap);
  fill(result?.cables ?? []);
}

/** Of a film without pictures: as large as its lines reach. */
function sizeOf(result) {
  if (!result) return null;
  if (result.width) return result;
  const points = result.cables.flatMap(({ centerline_xy: line }) => line);
  const [width, height] = [0, 1].map((axis) => Math.ceil(Math.max(1, ...points.map((point) => point[axis]))) + 1);
  return { width, height };
}

function fill(cables) {
  byId("count").value = cables.length || "";
  byId("cables").replaceChildren(...cables.map((cable) => {
    const made = element("button", "", "", { type: "button" });
    made.append(swatch(cable.id), element("span", "size", t(cable.state.replaceAll("_", " "))), element("span", "ends"), element("span", "score", cable.certainty.toFixed(2)));
    for (const [event, id] of [["pointerenter", cable.id], ["focus", cable.id], ["pointerleave", null], ["blur", null]]) {
      made.addEventListener(event, () => {
        page.focus = id;
        stage.redraw();
      });
    }
    const row = element("li");
    row.append(made);
    return row;
  }));
}

const STYLE = { seen: [], partly_covered: [8, 6], lost: [2, 7], new: [] };

function paint(context, { scale }) {
  context.save();
  context.beginPath();
  context.rect(0, 0, stage.size.width * scale, stage.size.height * scale);
  context.clip(); // a covered cable may be supposed to go on beyond the border
  for (const { id, state, centerline_xy: line } of page.results[page.at]?.cables ?? []) {
    const at = ([x, y]) => [(x + 0.5) * scale, (y + 0.5) * scale];
    const path = new Path2D();
    line.forEach((point, i) => path[i ? "lineTo" : "moveTo"](...at(point)));
    context.globalAlpha = !page.focus || page.focus === id ? 1 : 0.25;
    context.setLineDash(STYLE[state] ?? []);
    for (const [tone, width] of [["#000a", 6], [color(id), 3.5]]) {
      Object.assign(context, { strokeStyle: tone, lineWidth: width });
      context.stroke(path);
    }
    context.setLineDash([]);
    if (line.length) plate(context, at(pointAt(line, 0.5)), id);
  }
  context.restore();
}

function plate(context, [x, y], id) {
  Object.assign(context, { fillStyle: color(id), font: "700 13px system-ui, sans-serif", textAlign: "center", textBaseline: "middle" });
  context.beginPath();
  context.arc(x, y, 11, 0, 2 * Math.PI);
  context.fill();
  context.fillStyle = inkOn(id);
  context.fillText(String(id), x, y + 0.5);
}

async function play() {
  page.playing = !page.playing;
  byId("play").textContent = t(page.playing ? "❚❚ Stop" : "▶ Play");
  while (page.playing) {
    const last = Number(byId("frame").max);
    await show(page.at >= last ? 0 : page.at + 1);
    if (page.at >= last) page.playing = false;
    await new Promise((resolve) => setTimeout(resolve, FRAME_MS));
  }
  byId("play").textContent = t("▶ Play");
}

shell();
stage.addButtons();
offer(byId("samples"), "cables", ([file]) => panned(file).then(choose).catch(report));
byId("file").addEventListener("change", (event) => choose([...event.target.files]));
byId("track").addEventListener("change", (event) => openTrack(event.target.files[0]).catch(report));
byId("form").addEventListener("submit", (event) => {
  event.preventDefault();
  guarded(run);
});
byId("cancel").addEventListener("click", () => page.stop?.abort());
byId("frame").addEventListener("input", (event) => show(event.target.valueAsNumber));
byId("play").addEventListener("click", play);
byId("save").addEventListener("click", () => {
  const text = page.results.map((result) => `${JSON.stringify(result)}\n`).join("");
  download(new Blob([text], { type: "application/jsonl" }), "track.jsonl");
});
onDrop(choose);
