// The corrector page: pictures, the tool in hand, and what it does to the label shown.

import { Api, ProblemError } from "./api.js";
import { add, certainty, join, remove, reshape, split, swap } from "./label_edit.js";
import { coco, finished, jsonLines } from "./label_save.js";
import { cheapest, prepare, settle, trace } from "./livewire.js";

const NEAR_PX = 12; // on the screen
const BRUSH_PX = 40; // how much of a line a drag takes along, in picture pixels to either side
const KEYS = { a: "add", m: "move", s: "split", j: "join", d: "delete", w: "swap" };
const HINTS = {
  add: "Click along the cable; Enter or a double click ends it, Backspace takes a click back, with Shift it is exact.",
  move: "Drag a line to where the cable is.",
  split: "Click where one cable should become two.",
  join: "Click two cables one after the other.",
  delete: "Click a cable to remove it.",
  swap: "Click a crossing to put the other cable on top.",
};
const byId = (id) => document.getElementById(id);
const canvas = byId("canvas");
const context = canvas.getContext("2d");
const api = new Api();
const pictures = []; // { file, bitmap, map, label, history, touched }
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
  const label = {
    format: "dlo-label/1", name: file.name, sha256: null, width, height, instances, crossings,
    origin: "service", method, threshold, models,
  };
  return { file, bitmap: await createImageBitmap(file), map: probability(mask), label, history: [], touched: false };
}

function probability(bitmap) {
  const sheet = new OffscreenCanvas(bitmap.width, bitmap.height).getContext("2d", { willReadFrequently: true });
  sheet.drawImage(bitmap, 0, 0);
  const { data } = sheet.getImageData(0, 0, bitmap.width, bitmap.height);
  const p = new Float32Array(bitmap.width * bitmap.height);
  for (let i = 0; i < p.length; i += 1) p[i] = data[4 * i] / 255;
  return { ...prepare(p, bitmap.width, bitmap.height), bitmap };
}

function show(picture) {
  [shown, clicks, chosen] = [picture, [], null];
  byId("drop").classList.remove("empty");
  canvas.width = picture.label.width;
  canvas.height = picture.label.height;
  canvas.setAttribute("aria-label", picture.label.name);
  list();
  draw();
}

function edit(label) {
  if (label === shown.label) return;
  shown.history.push(shown.label);
  shown.label = label;
  shown.touched = true;
  list();
  draw();
}

function undo() {
  if (!shown?.history.length) return;
  shown.label = shown.history.pop();
  list();
  draw();
}

// The tools -------------------------------------------------------------------------------------------------------

const snapped = (points) => (byId("snap").checked ? trace(shown.map, points) : { line: points.map(([x, y]) => [x, y]), width: null });

function finishLine() {
  if (clicks.length > 1) {
    const { line, width, taper } = snapped(clicks);
    edit(add(shown.label, line, width, taper));
  }
  clicks = [];
  draw();
}

function click(point, exact) {
  const near = nearest(point);
  switch (tool()) {
    case "add":
      clicks.push([...point, exact]);
      break;
    case "split":
      if (near) edit(split(shown.label, near.instance.id, near.index));
      break;
    case "join":
      if (near && chosen && chosen !== near.instance.id) {
        const bridge = (from, to) => (byId("snap").checked ? cheapest(shown.map, from, to) : [from, to]);
        edit(join(shown.label, chosen, near.instance.id, bridge));
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

/** The line with everything near the grabbed point moved along, less with distance. */
function dragged({ instance, index, from }, to) {
  const [dx, dy] = [to[0] - from[0], to[1] - from[1]];
  const origin = instance.centerline_xy[index];
  return instance.centerline_xy.map((point) => {
    const weight = Math.exp(-((away(point, origin) / BRUSH_PX) ** 2));
    return [point[0] + weight * dx, point[1] + weight * dy];
  });
}

function drop(point) {
  const line = dragged(drag, point);
  const { line: settled, width, taper } = byId("snap").checked ? settle(shown.map, line) : { line };
  edit(reshape(shown.label, drag.instance.id, settled, width, taper));
}

const away = ([a, b], [c, d]) => Math.hypot(a - c, b - d);
const reach = () => (NEAR_PX * canvas.width) / (canvas.getBoundingClientRect().width || canvas.width);

function nearest(point) {
  let best = null;
  for (const instance of shown.label.instances) {
    instance.centerline_xy.forEach((xy, index) => {
      const distance = away(xy, point);
      if (distance < (best?.distance ?? Math.max(reach(), instance.width_px))) best = { instance, index, distance };
    });
  }
  return best;
}

function position(event) {
  const box = canvas.getBoundingClientRect();
  return [
    ((event.clientX - box.left) / box.width) * canvas.width - 0.5,
    ((event.clientY - box.top) / box.height) * canvas.height - 0.5,
  ];
}

// What is seen ----------------------------------------------------------------------------------------------------

function draw() {
  if (!shown) return;
  context.drawImage(shown.bitmap, 0, 0, canvas.width, canvas.height);
  if (byId("probability").checked) {
    context.globalAlpha = 0.7;
    context.drawImage(shown.map.bitmap, 0, 0, canvas.width, canvas.height);
    context.globalAlpha = 1;
  }
  for (const instance of shown.label.instances) {
    const moving = drag?.instance.id === instance.id && pointer;
    stroke(moving ? dragged(drag, pointer) : instance.centerline_xy, color(instance.id), instance.id === chosen ? 4 : 2);
  }
  for (const { xy, score } of shown.label.crossings) ring(xy, score > 0.5 ? "#fff" : "#ffd500");
  if (clicks.length) {
    const points = pointer && tool() === "add" ? [...clicks, pointer] : clicks;
    if (points.length > 1) stroke(snapped(points).line, "#fff", 2);
    for (const xy of clicks) ring(xy, "#fff", 3);
  }
}

function stroke(line, style, width) {
  context.lineJoin = context.lineCap = "round";
  context.beginPath();
  line.forEach(([x, y], i) => (i ? context.lineTo(x + 0.5, y + 0.5) : context.moveTo(x + 0.5, y + 0.5)));
  for (const [color, extra] of [["#0008", 2], [style, 0]]) {
    context.strokeStyle = color;
    context.lineWidth = width + extra;
    context.stroke();
  }
}

function ring([x, y], style, radius = 7) {
  context.beginPath();
  context.arc(x + 0.5, y + 0.5, radius, 0, 2 * Math.PI);
  context.strokeStyle = style;
  context.lineWidth = 2;
  context.stroke();
}

function list() {
  byId("count").textContent = pictures.length ? String(pictures.length) : "";
  fill("pictures", pictures, (picture) => {
    const mark = picture.touched ? "corrected" : `certainty ${certainty(picture.label).toFixed(2)}`;
    return [`${picture.label.name}: ${mark}`, picture === shown, () => show(picture)];
  });
  fill("instances", shown?.label.instances ?? [], (item) => {
    const text = `${item.id}: ${item.width_px.toFixed(1)} px${item.score == null ? ", yours" : `, score ${item.score.toFixed(2)}`}`;
    return [text, item.id === chosen, () => ((chosen = item.id), list(), draw())];
  });
  byId("undo").disabled = !shown?.history.length;
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

const all = () => pictures.map((picture) => finished(picture.label, byId("contour").checked ? picture.map : null));
byId("save").addEventListener("click", () => save("labels.jsonl", jsonLines(all())));
byId("save-coco").addEventListener("click", () => save("coco.json", coco(all())));
byId("undo").addEventListener("click", undo);
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
    drag = { ...near, from: point };
    canvas.setPointerCapture(event.pointerId);
  } else click(point, event.shiftKey);
});
canvas.addEventListener("pointermove", (event) => {
  pointer = position(event);
  if (drag || clicks.length) draw();
});
canvas.addEventListener("pointerup", (event) => {
  if (drag) drop(position(event));
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
  else if (event.key === "z" && (event.ctrlKey || event.metaKey)) undo();
  else if (KEYS[event.key] && !event.ctrlKey && !event.metaKey) document.querySelector(`[value=${KEYS[event.key]}]`).click();
  else return;
  event.preventDefault();
  draw();
});
byId("hint").textContent = HINTS.add;
list();
