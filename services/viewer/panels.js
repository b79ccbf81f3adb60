// The lists beside the picture. Text from the service enters as text, never as HTML.

import { byId, element } from "./dom.js";
import { t } from "./i18n.js";
import { culpritsOf } from "./overlay.js";
import { orderKnown } from "./strands.js";
import { swatch } from "./swatches.js";

/** `onHover(focus)` and `onClick(focus)` get `{ instance }` or `{ crossing }`, or null when left. */
export function showResult(result, onHover, onClick) {
  const rows = {
    instances: result.instances.map((instance) => [{ instance: instance.id }, instanceRow(instance)]),
    crossings: result.crossings.map((crossing) => [{ crossing: crossing.id }, crossingRow(crossing)]),
  };
  const doubtful = new Set(culpritsOf(result).map(({ score, ...focus }) => JSON.stringify(focus)));
  for (const [name, entries] of Object.entries(rows)) {
    const items = entries.map(([focus, parts]) => item(focus, parts, onHover, onClick, doubtful));
    byId(name).replaceChildren(...(items.length ? items : [element("li", "none", t("none found"))]));
  }
  byId("status").textContent = statusOf(result.status);
  byId("status").className = result.status.code === "ok" ? "sure" : "unsure";
  byId("warnings").replaceChildren(...(result.warnings ?? []).map((text) => element("li", "", text)));
  byId("instance-count").value = result.instances.length;
  byId("crossing-count").value = result.crossings.length;
}

export function clearResult() {
  for (const id of ["status", "warnings", "instances", "crossings", "timings", "bar", "files"]) byId(id).replaceChildren();
  byId("status").className = "";
  for (const id of ["instance-count", "crossing-count", "total"]) byId(id).value = "";
}

/** Marks the rows of what is in focus and of what was clicked. */
export function showFocus(focus, pinned) {
  for (const row of document.querySelectorAll(".list button")) {
    row.classList.toggle("focused", row.dataset.focus === JSON.stringify(focus));
    row.setAttribute("aria-pressed", row.dataset.focus === JSON.stringify(pinned));
  }
}

/** The bar shows the stages; `stage.step` is a part of a stage and stands below it in the list. */
export function showTimings(timings) {
  const stages = Object.entries(timings).filter(([name]) => !name.includes(".") && name !== "total");
  const total = timings.total ?? stages.reduce((sum, [, value]) => sum + value, 0);
  byId("total").value = `${total.toFixed(1)} ms`;
  byId("bar").replaceChildren(...stages.map(([, value], i) => timingBar(value, i)));
  const rows = stages.flatMap(([stage, value], i) => {
    const steps = Object.entries(timings).filter(([name]) => name.startsWith(`${stage}.`));
    const step = ([name, part]) => timingRow("step", name.slice(stage.length + 1), part);
    return [timingRow(`stage-${i % 6}`, stage, value), ...steps.map(step)];
  });
  byId("timings").replaceChildren(...rows);
}

/** Buttons for the files, and what there is of `more` beside them. */
export function showFiles(names, onSave, more = []) {
  const buttons = names.map((name) => {
    const button = element("button", "", name);
    button.type = "button";
    button.addEventListener("click", () => onSave(name));
    return button;
  });
  byId("files").replaceChildren(...buttons, ...more.filter(Boolean));
}

const REASONS = {
  gap: "gap",
  border: "cut by the border",
  parallel: "beside another",
  low_contrast: "low contrast",
  blur: "blurred",
  lookalike: "may be no cable",
  free_ends: "both ends inside the picture",
  short: "short",
  odd_width: "of another width",
  no_picture: "a mask only",
  crossing: "a crossing that may be none",
  order: "which one is on top",
};

const inWords = (reasons) => reasons.map((reason) => t(REASONS[reason] ?? reason)).join(", ");

function statusOf({ code, limit, reasons }) {
  if (code === "none_found") return t("No cable is seen");
  if (code === "ok") return t("Sure: every score is at least {limit}", { limit });
  return t("Unsure: a score is below {limit}", { limit }) + (reasons.length ? ` (${inWords(reasons)})` : "");
}

function instanceRow({ id, score, width_px, length_px, closed, endpoints, reasons, ...measured }) {
  const ends = [closed ? t("closed ring") : endpoints.map(({ kind }) => t(kind)).join(" – ")];
  if (measured.curve_m) ends.unshift(inMeters(measured));
  if (reasons.length) ends.push(inWords(reasons));
  const size = `${width_px.toFixed(1)} × ${length_px.toFixed(0)} px`;
  return [swatch(id), element("span", "size", size), element("span", "ends", ends.join("; ")), scoreOf(score)];
}

/** What depth has measured: length, thickness, and how far both may be off. */
function inMeters({ curve_m, radius_m, sigma_m }) {
  const length = curve_m.slice(1).reduce((sum, point, i) => sum + Math.hypot(...point.map((v, k) => v - curve_m[i][k])), 0);
  const middle = sigma_m?.toSorted((a, b) => a - b)[Math.floor(sigma_m.length / 2)];
  return [
    `${(100 * length).toFixed(1)} cm`, ...(radius_m ? [`⌀ ${(2000 * radius_m).toFixed(1)} mm`] : []),
    ...(middle ? [`σ ${(1000 * middle).toFixed(1)} mm`] : []),
  ].join(", ");
}

function crossingRow(crossing) {
  const { over, under, score } = crossing;
  const swatches = [over, under].map(({ instance }) => swatch(instance));
  const known = orderKnown(crossing);
  return [swatches[0], element("span", "size", t(known ? "over" : "and")), swatches[1],
    element("span", "ends", known ? "" : t("order unknown")), scoreOf(score)];
}

function scoreOf(score) {
  return element("span", "score", score.toFixed(2));
}

function item(focus, parts, onHover, onClick, doubtful) {
  const button = element("button", doubtful.has(JSON.stringify(focus)) ? "culprit" : "");
  button.type = "button";
  button.dataset.focus = JSON.stringify(focus);
  button.append(...parts);
  for (const event of ["pointerenter", "focus"]) button.addEventListener(event, () => onHover(focus));
  for (const event of ["pointerleave", "blur"]) button.addEventListener(event, () => onHover(null));
  button.addEventListener("click", () => onClick(focus));
  const row = element("li");
  row.append(button);
  return row;
}

function timingRow(className, name, value) {
  const row = element("li", className);
  const label = element("span", "", name.replaceAll("_", " "));
  row.append(label, element("b", "", `${value.toFixed(1)} ms`));
  return row;
}

function timingBar(value, index) {
  const part = element("span", `stage-${index % 6}`);
  part.style.flexGrow = value;
  return part;
}
