// The corrector page: pictures, the tool in hand, and what it does to the label shown.

import { Api, ProblemError } from "./api.js";
import { dragged, dropped, grabbed } from "./label_drag.js";
import { add, certainty, join, remove, reshape, shapeOf, split, swap } from "./label_edit.js";
import { coco, finished, jsonLines } from "./label_save.js";
import { prepare, trace } from "./livewire.js";
import { outlined, stroke } from "./outline.js";
import { paint } from "./strip.js";

const NEAR_PX = 12; // on the screen
const MOST_ZOOM = 3;
const USUAL_PX = 6; // the width of a line that does not snap
const KEYS = { a: "add", m: "move", s: "split", j: "join", d: "delete", w: "swap" };
const HINTS = {
  add: "Click the ends of a cable, and between them where the line would leave it; Enter or a double click ends it, Backspace takes a click back.",
  move: "Drag a line to where the cable is, or an edge to where it ends; with Shift both edges.",
  split: "Click where one cable should become two.",
  join: "Click two cables one after the other.",
  delete: "Click a cable to remove it.",
  swap: "Click a crossing to put the other cable on top.",
};
const byId = (id) => document.getElementById(id);
const canvas = byId("canvas");
const context = canvas.getContext("2d");
const api = new Api();
const pictures = []; // { file, bitmap, mask, label, history, confirmed }
let zoom = 1; // screen pixels a picture pixel
let view = null; // of the picture shown: probability, depth and planes
let [shown, clicks, chosen, drag, pointer] = [null, [], null, null, null];

const tool = () => document.querySelector("[name=tool]:checked").value;
const color = (id) => `hsl(${(id * 222.5) % 360} 85% 55%)`;

async function open(files) {
  showError(null);
  for (const file of files) {
    byId("hint").textContent = `${file.name}: asking the service …`;
    try {
      pictures.push(await analyzed(file));
    } catch (error) {
      showError(`${file.name}: ${error instanceof ProblemError ? error.problem.detail : error.message}`);
      continue;
    }
    pictures.sort((a, b) => certainty(a.label) - certainty(b.label));
    if (!shown) show(pictures[0]);
    list();
  }
  byId("hint").textContent = HINTS[tool()];
}

async function analyzed(file) {
  const job = await api.run({ kind: "instances", files: ["mask"] }, file, () => {});
  const { width, height, instances, crossings, method, threshold, models } = job.result;
  const mask = await createImageBitmap(await api.file(job.id, "mask.png"));
  const sha256 = await api.digest(file);
  const name = file.webkitRelativePath || file.name;
  const label = {
    format: "dlo-label/1", name, sha256, width, height, instances, crossings,
    origin: "service", method, threshold, models,
  };
  const bitmap = await api.bitmap(file);
  if (!bitmap) throw new Error("this picture cannot be shown here");
  return { file, bitmap, mask, label, history: [], confirmed: false };
}

function prepared({ bitmap, mask, label: { width, height } }) {
  const seen = pixels(mask, width, height);
  const p = new Float32Array(width * height);
  for (let i = 0; i < p.length; i += 1) p[i] = seen[4 * i] / 255;
  return { ...prepare(p, width, height), planes: paint(pixels(bitmap, width, height), width, height) };
}

function pixels(bitmap, width, height) {
  const sheet = new OffscreenCanvas(width, height).getContext("2d", { willReadFrequently: true });
  sheet.drawImage(bitmap, 0, 0, width, height);
  return sheet.getImageData(0, 0, width, height).data;
}

function show(picture) {
  [shown, clicks, chosen, view] = [picture, [], null, prepared(picture)];
  byId("drop").classList.remove("empty");
  // Half a pixel matters at an edge: a small picture is shown as large as it fits.
  zoom = Math.max(1, Math.min(MOST_ZOOM, byId("drop").clientWidth / picture.label.width));
  canvas.width = picture.label.width * zoom;
  canvas.height = picture.label.height * zoom;
  canvas.setAttribute("aria-label", picture.label.name);
  list();
  draw();
}

function edit(label) {
  if (label === shown.label) return;
  shown.history.push(shown.label);
  shown.label = label;
  list();
  draw();
}

function undo() {
  if (!shown?.history.length) return;
  shown.label = shown.history.pop();
  list();
  draw();
}

/** Whether somebody's word stands behind a label: only then it is a correction. */
const isConfirmed = ({ history, confirmed }) => confirmed || history.length > 0;

function confirm() {
  if (!shown) return;
  shown.confirmed = !shown.confirmed;
  list();
}

// The tools -------------------------------------------------------------------------------------------------------

const snaps = () => byId("snap").checked;
const shaped = (points, pulls, width = USUAL_PX) => (snaps() ? outlined(view, points, pulls) : stroke(points, width, pulls));

function finishLine() {
  if (clicks.some((one) => away(one, clicks[0]) > 1)) edit(add(shown.label, shaped(clicks, [])));
  clicks = [];
  draw();
}

function click(point) {
  const near = nearest(point);
  switch (tool()) {
    case "add":
      clicks.push(point);
      break;
    case "split":
      if (near) edit(split(shown.label, near.instance.id, near.index));
      break;
    case "join":
      if (near && chosen && chosen !== near.instance.id) {
        edit(join(shown.label, chosen, near.instance.id, shaped));
        chosen = null;
      } else chosen = near?.instance.id ?? null;
      break;
    case "delete":
      if (near) edit(remove(shown.label, near.instance.id));
      break;
    case "swap": {
      const hit = shown.label.crossings.find(({ xy }) => away(xy, point) < 2 * reach());
      if (hit) edit(swap(shown.label, hit.id));
      break;
    }
    default:
  }
  draw();
}

function drop(drag, to) {
  if (away(drag.from, to) < 0.1) return;
  const { clicks, pulls } = dropped(drag, to);
  edit(reshape(shown.label, drag.instance.id, shaped(clicks, pulls, drag.instance.width_px)));
}

const away = ([a, b], [c, d]) => Math.hypot(a - c, b - d);
const reach = () => (NEAR_PX * shown.label.width) / (canvas.getBoundingClientRect().width || canvas.width);

function nearest(point) {
  let best = null;
  for (const instance of shown.label.instances) {
    shapeOf(instance).line.forEach((xy, index) => {
      const distance = away(xy, point);
      if (distance < (best?.distance ?? Math.max(reach(), instance.width_px))) best = { instance, index, distance };
    });
  }
  return best;
}

function position(event) {
  const box = canvas.getBoundingClientRect();
  return [
    ((event.clientX - box.left) / box.width) * shown.label.width - 0.5,
    ((event.clientY - box.top) / box.height) * shown.label.height - 0.5,
  ];
}

// What is seen ----------------------------------------------------------------------------------------------------

function draw() {
  if (!shown) return;
  const { width, height } = shown.label;
  context.setTransform(zoom, 0, 0, zoom, 0, 0);
  context.drawImage(shown.bitmap, 0, 0, width, height);
  if (byId("probability").checked) {
    context.globalAlpha = 0.7;
    context.drawImage(shown.mask, 0, 0, width, height);
    context.globalAlpha = 1;
  }
  for (const instance of shown.label.instances) {
    const moving = drag?.instance.id === instance.id && pointer;
    const shape = moving ? dragged(drag, pointer) : instance.shape;
    if (shape) for (const edge of [shape.low, shape.high]) curve(beside(shape, edge), color(instance.id), 1);
    curve(shape?.line ?? instance.centerline_xy, color(instance.id), instance.id === chosen ? 4 : 2);
  }
  for (const { xy, score } of shown.label.crossings) ring(xy, score > 0.5 ? "#fff" : "#ffd500");
  if (clicks.length) {
    const points = pointer && tool() === "add" ? [...clicks, pointer] : clicks;
    if (points.length > 1) curve(snaps() ? trace(view, points).line : points, "#fff", 2);
    for (const xy of clicks) ring(xy, "#fff", 3);
  }
}

const beside = ({ line, normals }, edge) => line.map(([x, y], i) => [x + edge[i] * normals[i][0], y + edge[i] * normals[i][1]]);

function curve(line, style, width) {
  context.lineJoin = context.lineCap = "round";
  context.beginPath();
  line.forEach(([x, y], i) => (i ? context.lineTo(x + 0.5, y + 0.5) : context.moveTo(x + 0.5, y + 0.5)));
  for (const [color, extra] of [["#0008", 2], [style, 0]]) {
    context.strokeStyle = color;
    context.lineWidth = (width + extra) / zoom;
    context.stroke();
  }
}

function ring([x, y], style, radius = 7) {
  context.beginPath();
  context.arc(x + 0.5, y + 0.5, radius / zoom, 0, 2 * Math.PI);
  context.strokeStyle = style;
  context.lineWidth = 2 / zoom;
  context.stroke();
}

function list() {
  byId("count").textContent = pictures.length ? String(pictures.length) : "";
  fill("pictures", pictures, (picture) => {
    const mark = picture.history.length ? "corrected" : picture.confirmed ? "confirmed" : `certainty ${certainty(picture.label).toFixed(2)}`;
    return [`${picture.label.name}: ${mark}`, picture === shown, () => show(picture)];
  });
  fill("instances", shown?.label.instances ?? [], (item) => {
    const text = `${item.id}: ${item.width_px.toFixed(1)} px${item.score == null ? ", yours" : `, score ${item.score.toFixed(2)}`}`;
    return [text, item.id === chosen, () => ((chosen = item.id), list(), draw())];
  });
  byId("undo").disabled = !shown?.history.length;
  byId("confirm").disabled = !shown || shown.history.length > 0;
  byId("confirm").setAttribute("aria-pressed", String(Boolean(shown?.confirmed)));
  byId("save").disabled = byId("save-coco").disabled = !pictures.length;
}

function fill(id, items, describe) {
  const rows = items.map((item) => {
    const [text, pressed, act] = describe(item);
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = text;
    button.setAttribute("aria-pressed", String(Boolean(pressed)));
    button.addEventListener("click", act);
    const row = document.createElement("li");
    row.append(button);
    return row;
  });
  byId(id).replaceChildren(...rows);
}

function showError(text) {
  byId("error").hidden = !text;
  byId("error").textContent = text ?? "";
}

function save(name, text) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([text], { type: "application/json" }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

// Wiring ----------------------------------------------------------------------------------------------------------

const all = () => pictures.map((picture) => finished(picture.label, isConfirmed(picture)));
byId("save").addEventListener("click", () => save("labels.jsonl", jsonLines(all())));
byId("save-coco").addEventListener("click", () => save("coco.json", coco(all())));
byId("undo").addEventListener("click", undo);
byId("confirm").addEventListener("click", confirm);
byId("probability").addEventListener("change", draw);
byId("file").addEventListener("change", (event) => open([...event.target.files]));
byId("key").addEventListener("change", (event) => (api.key = event.target.value));
byId("tools").addEventListener("change", () => {
  [clicks, chosen] = [[], null];
  byId("hint").textContent = HINTS[tool()];
  draw();
});
byId("drop").addEventListener("dragover", (event) => event.preventDefault());
byId("drop").addEventListener("drop", (event) => {
  event.preventDefault();
  open([...event.dataTransfer.files]);
});
canvas.addEventListener("pointerdown", (event) => {
  if (!shown || event.button) return;
  const point = position(event);
  const near = nearest(point);
  if (tool() === "move" && near) {
    drag = grabbed(near.instance, shapeOf(near.instance), near.index, point, event.shiftKey);
    canvas.setPointerCapture(event.pointerId);
  } else click(point);
});
canvas.addEventListener("pointermove", (event) => {
  if (!shown) return;
  pointer = position(event);
  if (drag || clicks.length) draw();
});
canvas.addEventListener("pointerup", (event) => {
  if (drag) drop(drag, position(event));
  drag = null;
  draw();
});
canvas.addEventListener("dblclick", () => {
  if (tool() !== "add") return;
  clicks.pop(); // the second click of the two
  finishLine();
});
document.addEventListener("keydown", (event) => {
  if (!shown || /^(INPUT|SELECT|TEXTAREA)$/.test(event.target.tagName) && event.target.type !== "radio") return;
  if (event.key === "Enter") finishLine();
  else if (event.key === "Escape") clicks = [];
  else if (event.key === "Backspace") clicks.pop();
  else if (event.key === "c" && !event.ctrlKey && !event.metaKey) confirm();
  else if (event.key === "z" && (event.ctrlKey || event.metaKey)) undo();
  else if (KEYS[event.key] && !event.ctrlKey && !event.metaKey) document.querySelector(`[value=${KEYS[event.key]}]`).click();
  else return;
  event.preventDefault();
  draw();
});
byId("hint").textContent = HINTS.add;
list();
