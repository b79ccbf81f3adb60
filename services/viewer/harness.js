// The harness page: a picture to its topology and the actions that disentangle it. Drawing is in harness_drawing.js.

import { Api } from "./api.js";
import { drawHarness } from "./harness_drawing.js";
import { color, erase } from "./overlay.js";
import { byId, showProblem } from "./panels.js";

const TALLEST = 0.72; // of the window
const LISTS = ["sections", "branches", "crossings", "actions"];

const api = new Api();
const canvas = byId("canvas");
const page = { file: null, bitmap: null, topology: null, actions: [], focus: null, chosen: 0, running: null };

async function choose(file) {
  if (!file) return;
  page.running?.abort();
  Object.assign(page, { file, bitmap: null });
  forget();
  byId("run").disabled = false;
  canvas.setAttribute("aria-label", file.name);
  const bitmap = await api.bitmap(file);
  if (page.file !== file) return; // another one was chosen meanwhile
  page.bitmap = bitmap;
  redraw();
  await run();
}

async function run() {
  page.running?.abort();
  const controller = (page.running = new AbortController());
  forget();
  byId("progress").hidden = false;
  try {
    const request = await requestOf();
    const part = byId("as").value === "mask" ? "mask" : "image";
    const follow = (job) => (byId("progress").value = job.progress);
    show(await api.run(request, page.file, follow, controller.signal, part));
  } catch (error) {
    if (!controller.signal.aborted) report(error);
  } finally {
    if (page.running === controller) byId("progress").hidden = true;
  }
}

/** Naming branches needs the drawing, which only `topology` takes. A request that names its network looks at every
    picture as a photograph. No files: this page draws by itself. */
async function requestOf() {
  const request = { kind: byId("kind").value, files: [] };
  if (byId("as").value === "photograph") request.model = await foregroundNetwork();
  const drawing = byId("drawing").files[0];
  if (!drawing) return request;
  return { ...request, kind: "topology", drawing: JSON.parse(await drawing.text()) };
}

async function foregroundNetwork() {
  const networks = await api.networks();
  return networks.find((network) => network.task === "foreground" && network.default)?.name;
}

function show(job) {
  const { result } = job;
  if (!result) return report(new Error(`the job was ${job.state}`));
  page.topology = result.kind === "topology" ? result : result.topology;
  page.actions = result.actions ?? [];
  page.chosen = 0;
  byId("status").value = result.status.replaceAll("_", " ");
  byId("message").textContent = [result.message, matchText(page.topology?.match)].filter(Boolean).join(" ");
  byId("warnings").replaceChildren(...(result.warnings ?? []).map((text) => part("li", "", text)));
  fill();
  const { sections, branch_points: branches, crossings } = page.topology;
  const found = `${sections.length} sections, ${branches.length} branch-points, ${crossings.length} crossings`;
  canvas.setAttribute("aria-label", `${page.file.name}: ${found}`);
  redraw();
}

function matchText(match) {
  if (!match) return "";
  const missing = match.missing.length ? `Missing: ${match.missing.join(", ")}.` : "Nothing is missing.";
  const extra = match.extra.length ? ` Not in the drawing: sections ${match.extra.join(", ")}.` : "";
  return `${missing}${extra}${match.ambiguous ? " Another assignment fits nearly as well." : ""}`;
}

function fill() {
  const { sections, branch_points: branches, crossings } = page.topology;
  const rows = {
    sections: sections.map((s) => [{ section: s.id }, color(s.id), s.id,
      `${s.name ? `${s.name}, ` : ""}${s.length_px.toFixed(0)} × ${s.width_px.toFixed(1)} px`, s.ends.join(" – "), s.score]),
    branches: branches.map((b) => [{ branch: b.id }, null, b.id,
      `${b.name ? `${b.name}, ` : ""}${b.sections.length} sections`, b.sections.join(", "), b.score]),
    crossings: crossings.map((c) => [{ crossing: c.id }, null, c.id,
      `${c.over.section} ${c.order_score > 0.5 ? "over" : "and"} ${c.under.section}`,
      c.order_score > 0.5 ? "" : "order unknown", c.score]),
    actions: page.actions.map((a, i) => [{ action: i }, null, a.rank,
      `section ${a.section}, ${((180 / Math.PI) * a.turn_rad).toFixed(0)}°${
        a.touching_branch_point ? `, if ${a.touching_branch_point} only touches` : ""}`,
      `${a.crossings_before} → ${a.crossings_after} crossings`, a.score]),
  };
  for (const [name, entries] of Object.entries(rows)) byId(name).replaceChildren(...entries.map(row));
  byId("section-count").value = sections.length;
  byId("branch-count").value = branches.length;
  byId("crossing-count").value = crossings.length;
  byId("action-count").value = page.actions.length;
}

function row([focus, swatch, number, text, more, score]) {
  const button = document.createElement("button");
  button.type = "button";
  const mark = part("i", "swatch", String(number));
  mark.style.background = swatch ?? "var(--line)";
  button.append(mark, part("span", "size", text), part("span", "ends", more), part("span", "score", score.toFixed(2)));
  const look = (at) => {
    page.focus = at;
    redraw();
  };
  for (const event of ["pointerenter", "focus"]) button.addEventListener(event, () => look(focus));
  for (const event of ["pointerleave", "blur"]) button.addEventListener(event, () => look(null));
  if (focus.action !== undefined) {
    button.title = page.actions[focus.action].why;
    button.addEventListener("click", () => {
      page.chosen = focus.action;
      redraw();
    });
  }
  const line = document.createElement("li");
  line.append(button);
  return line;
}

function part(tag, className, text) {
  const made = document.createElement(tag);
  made.className = className;
  made.textContent = text;
  return made;
}

function forget() {
  Object.assign(page, { topology: null, actions: [], focus: null, chosen: 0 });
  showProblem(null);
  for (const name of LISTS) byId(name).replaceChildren();
  for (const name of ["status", "section-count", "branch-count", "crossing-count", "action-count"]) byId(name).value = "";
  byId("message").textContent = "";
  byId("warnings").replaceChildren();
  redraw();
}

function report(error) {
  showProblem(error.problem ?? { title: "This did not work", detail: error.message, errors: [] });
}

function redraw() {
  const size = page.topology ?? page.bitmap;
  byId("drop").classList.toggle("empty", !size);
  if (!size) return erase(canvas);
  const scale = Math.min(byId("drop").clientWidth / size.width, (TALLEST * innerHeight) / size.height);
  canvas.style.width = `${size.width * scale}px`;
  canvas.style.height = `${size.height * scale}px`;
  canvas.width = Math.max(1, Math.round(size.width * scale * devicePixelRatio));
  canvas.height = Math.max(1, Math.round(size.height * scale * devicePixelRatio));
  const shown = new Set([...byId("layers").querySelectorAll("input:checked")].map(({ name }) => name));
  const action = page.actions[page.focus?.action ?? page.chosen];
  drawHarness(canvas.getContext("2d"), page, action, { scale, density: devicePixelRatio, shown });
}

byId("file").addEventListener("change", (event) => choose(event.target.files[0]));
byId("form").addEventListener("submit", (event) => {
  event.preventDefault();
  run();
});
byId("key").addEventListener("change", (event) => (api.key = event.target.value.trim()));
byId("layers").addEventListener("change", redraw);
addEventListener("resize", redraw);
addEventListener("dragover", (event) => event.preventDefault());
addEventListener("drop", (event) => {
  event.preventDefault();
  byId("file").files = event.dataTransfer.files;
  choose(event.dataTransfer.files[0]);
});
