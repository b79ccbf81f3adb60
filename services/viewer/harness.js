// The harness page: a picture to its topology and the actions that disentangle it. Drawing is in harness_drawing.js.

import { api } from "./api.js";
import { codeCard, showCode } from "./code_card.js";
import { byId, element as part, onDrop, problemOf, showProblem } from "./dom.js";
import { drawHarness } from "./harness_drawing.js";
import { t } from "./i18n.js";
import { recipeLink } from "./joblinks.js";
import { follow, remember } from "./permalink.js";
import { offer } from "./samples.js";
import { shell } from "./shell.js";
import { Stage } from "./stage.js";
import { swatch } from "./swatches.js";

const LISTS = ["sections", "branches", "crossings", "actions"];
const PLAY_MS = 2600;

const canvas = byId("canvas");
const stage = new Stage(canvas, paint);
const page = { file: null, bitmap: null, topology: null, actions: [], focus: null, chosen: 0, running: null, job: null };

async function choose(file) {
  if (!file) return;
  page.running?.abort();
  Object.assign(page, { file, bitmap: null });
  byId("depth").value = ""; // that of another picture
  forget();
  byId("run").disabled = false;
  showRequest();
  canvas.setAttribute("aria-label", file.name);
  const bitmap = await api.bitmap(file);
  if (page.file !== file) return; // another one was chosen meanwhile
  page.bitmap = bitmap;
  place();
  await run();
}

async function run() {
  page.running?.abort();
  const controller = (page.running = new AbortController());
  forget();
  byId("progress").hidden = false;
  page.job = null;
  try {
    const request = { ...(await requestOf()), files: [] }; // this page draws by itself
    const job = await api.run(request, partsOf(page.file, (file) => file), onJob, controller.signal);
    show(job);
    remember({ ...page }, job.id);
  } catch (error) {
    if (!controller.signal.aborted) report(error);
  } finally {
    if (page.running === controller) byId("progress").hidden = byId("cancel").hidden = true;
  }
}

function onJob(job) {
  page.job = job;
  byId("cancel").hidden = false;
  byId("progress").value = job.progress;
}

async function cancel() {
  page.running?.abort();
  byId("progress").hidden = byId("cancel").hidden = true;
  if (page.job) await api.cancel(page.job.id).catch(report);
  showProblem({ title: t("The job was cancelled"), detail: "", errors: [] });
}

/** Naming branches needs the drawing, which only `topology` takes. A request that names its network looks at every
    picture as a photograph. */
async function requestOf() {
  const request = { kind: byId("kind").value };
  if (byId("as").value === "photograph") request.model = await foregroundNetwork();
  const drawing = byId("drawing").files[0];
  if (!drawing) return request;
  return { ...request, kind: "topology", drawing: JSON.parse(await drawing.text()) };
}

/** The picture and its depth, which shows what lies on top; `as` tells what is taken of each file. */
function partsOf(picture, as) {
  const depth = byId("depth").files[0];
  return { [byId("as").value === "mask" ? "mask" : "image"]: picture, ...(depth ? { depth: as(depth) } : {}) };
}

async function showRequest() {
  const request = await requestOf().catch(() => null);
  if (request) showCode(request, partsOf(page.file?.name ?? "harness.png", ({ name }) => name), t("Harness"));
}

async function foregroundNetwork() {
  const networks = await api.networks();
  return networks.find((network) => network.task === "foreground" && network.default)?.name;
}

function show(job) {
  const { result } = job;
  if (!result) return report(new Error(t("The job was {state}", { state: t(job.state) })));
  page.topology = result.kind === "topology" ? result : result.topology;
  page.actions = result.actions ?? [];
  page.chosen = 0;
  byId("status").value = t(result.status.replaceAll("_", " "));
  byId("playing").hidden = !page.actions.length;
  byId("share").value = 0;
  byId("message").textContent = [outcome(result), matchText(page.topology?.match)].filter(Boolean).join(" ");
  byId("warnings").replaceChildren(...(result.warnings ?? []).map((text) => part("li", "", text)));
  byId("after").replaceChildren(recipeLink(job) ?? "");
  fill();
  const { sections, branch_points: branches, crossings } = page.topology;
  const counts = { a: sections.length, b: branches.length, c: crossings.length };
  const found = t("{a} sections, {b} branch-points, {c} crossings", counts);
  canvas.setAttribute("aria-label", `${page.file.name}: ${found}`);
  place();
}

/** What was planned, in the language of the page; of what seldom happens the service's own English. */
function outcome({ status, message }) {
  const [[best], all] = [page.actions, page.topology?.crossings.length];
  if (status === "no_crossing") return t("There is no crossing to remove.");
  if (status !== "planned" || best.crossings_after >= best.crossings_before) return message;
  return t("{n} actions, the best leaves {a} of {b} crossings.", { n: page.actions.length, a: best.crossings_after, b: all });
}

function matchText(match) {
  if (!match) return "";
  const parts = [match.missing.length ? t("Missing: {names}.", { names: match.missing.join(", ") }) : t("Nothing is missing.")];
  if (match.extra.length) parts.push(t("Not in the drawing: sections {names}.", { names: match.extra.join(", ") }));
  if (match.ambiguous) parts.push(t("Another assignment fits nearly as well."));
  return parts.join(" ");
}

function fill() {
  const { sections, branch_points: branches, crossings } = page.topology;
  const rows = {
    sections: sections.map((s) => [{ section: s.id }, true, s.id,
      `${s.name ? `${s.name}, ` : ""}${s.length_px.toFixed(0)} × ${s.width_px.toFixed(1)} px`, s.ends.map((end) => t(end)).join(" – "), s.score]),
    branches: branches.map((b) => [{ branch: b.id }, false, b.id,
      `${b.name ? `${b.name}, ` : ""}${t("{n} sections", { n: b.sections.length })}`, b.sections.join(", "), b.score]),
    crossings: crossings.map((c) => [{ crossing: c.id }, false, c.id,
      `${c.over.section} ${t(c.order_score > 0.5 ? "over" : "and")} ${c.under.section}`,
      c.order_score > 0.5 ? "" : t("order unknown"), c.score]),
    actions: page.actions.map((a, i) => [{ action: i }, false, a.rank,
      t("section {n}, {angle}°", { n: a.section, angle: ((180 / Math.PI) * a.turn_rad).toFixed(0) }) + (
        a.touching_branch_point ? t(", if {n} only touches", { n: a.touching_branch_point }) : ""),
      t("{a} → {b} crossings", { a: a.crossings_before, b: a.crossings_after }), a.score]),
  };
  for (const [name, entries] of Object.entries(rows)) byId(name).replaceChildren(...entries.map(row));
  byId("section-count").value = sections.length;
  byId("branch-count").value = branches.length;
  byId("crossing-count").value = crossings.length;
  byId("action-count").value = page.actions.length;
}

function row([focus, colored, number, text, more, score]) {
  const button = document.createElement("button");
  button.type = "button";
  const mark = colored ? swatch(number) : part("i", "swatch", String(number));
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

function forget() {
  Object.assign(page, { topology: null, actions: [], focus: null, chosen: 0 });
  showProblem(null);
  for (const name of LISTS) byId(name).replaceChildren();
  for (const name of ["status", "section-count", "branch-count", "crossing-count", "action-count"]) byId(name).value = "";
  byId("message").textContent = "";
  byId("warnings").replaceChildren();
  byId("after").replaceChildren();
  byId("playing").hidden = true;
  place();
}

function report(error) {
  showProblem(problemOf(error));
}

function place() {
  stage.show(page.topology ?? page.bitmap, page.bitmap);
}

const redraw = () => stage.redraw();

function paint(context, view) {
  const shown = new Set([...byId("layers").querySelectorAll("input:checked")].map(({ name }) => name));
  const action = page.actions[page.focus?.action ?? page.chosen];
  drawHarness(context, page, action, { ...view, shown, share: byId("share").valueAsNumber });
}

/** Moves the slider from its place to the end; somebody who wants less motion has the slider. */
function play() {
  const slider = byId("share");
  const from = slider.valueAsNumber >= 1 ? 0 : slider.valueAsNumber;
  if (matchMedia("(prefers-reduced-motion: reduce)").matches) {
    slider.value = 1;
    return redraw();
  }
  const start = performance.now() - from * PLAY_MS;
  const action = page.chosen;
  const frame = (now) => {
    if (page.chosen !== action || byId("playing").hidden) return;
    slider.value = Math.min(1, (now - start) / PLAY_MS);
    redraw();
    if (slider.valueAsNumber < 1) requestAnimationFrame(frame);
  };
  requestAnimationFrame(frame);
}

function opened(job, picture) {
  Object.assign(page, { file: new File([], job.label ?? job.id), bitmap: picture });
  show(job);
}

shell(showRequest);
codeCard();
showRequest();
stage.addButtons();
offer(byId("samples"), "harness", ([file]) => choose(file));
byId("file").addEventListener("change", (event) => choose(event.target.files[0]));
byId("form").addEventListener("submit", (event) => {
  event.preventDefault();
  run();
});
byId("form").addEventListener("input", showRequest);
byId("cancel").addEventListener("click", cancel);
byId("play").addEventListener("click", play);
for (const event of ["input", "change"]) byId("layers").addEventListener(event, redraw);
onDrop(([file]) => choose(file));
const answers = (known) => {
  Object.assign(page, known);
  fill();
  place();
};
follow(["plan_disentangle", "topology"], opened, report, answers);
