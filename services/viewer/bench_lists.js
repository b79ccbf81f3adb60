// The lists beside the picture of the label bench: progress, pictures, cables, and whether all is saved.

import { stateOf } from "./bench.js";
import { button, byId, element, refill } from "./dom.js";
import { t } from "./i18n.js";
import { swatch } from "./swatches.js";

const LISTED = 120; // pictures at most

/** Fills all of them anew. `saving` is the state of a folder; `show(picture)`, `choose(what)` and
 *  `hover(what)` are called for what somebody points at. */
export function fillLists({ bench, chosen, saving, show, choose, hover }) {
  const { pictures, shown } = bench;
  const label = bench.label();
  const count = (state) => pictures.filter((picture) => stateOf(picture) === state).length;
  const counts = { n: count("confirmed"), m: pictures.length, k: count("changed") };
  byId("count").value = pictures.length ? t("{n} of {m} confirmed, {k} changed", counts) : "";
  byId("progress").value = pictures.length ? counts.n / counts.m : 0;
  refill(byId("pictures"), around(pictures, shown).map((picture) => pictureRow(picture, picture === shown, show)));
  byId("cable-count").value = label ? label.instances.length : "";
  refill(byId("instances"), (label?.instances ?? []).map((item) => instanceRow(item, chosen, choose, hover)));
  byId("undo").disabled = !shown || shown.at === 0;
  byId("redo").disabled = !shown?.steps || shown.at >= shown.steps.length - 1;
  byId("confirm").disabled = !label;
  byId("confirm").setAttribute("aria-pressed", String(Boolean(shown?.confirmed)));
  byId("confirm").textContent = t(shown?.confirmed ? "Confirmed" : "Confirm");
  byId("save").disabled = byId("clear").disabled = !pictures.length;
  showSaved(bench, saving);
}

/** Of thousands only those beside the one shown: a list is made anew after every edit. */
function around(pictures, shown) {
  const from = Math.max(0, Math.min(pictures.indexOf(shown) - LISTED / 2, pictures.length - LISTED));
  return pictures.slice(from, from + LISTED);
}

const SAVING = {
  saving: "Saving to the folder …",
  saved: "Saved in the folder.",
  failed: "Kept in this browser; the folder could not be reached.",
};

/** Whether all that was done is kept. */
export function showSaved({ shown, unkept }, saving) {
  const here = unkept ? "Keeping this step …" : "Every step is kept in this browser.";
  byId("saved").textContent = shown ? t(shown.folder || shown.disk ? (SAVING[saving] ?? "") : here) : "";
}

function pictureRow(picture, pressed, show) {
  const state = stateOf(picture);
  const certainty = t("certainty {x}", { x: picture.certainty.toFixed(2) });
  const text = state === "new" ? (picture.seen ? certainty : t(picture.state ?? "not opened yet")) : t(state);
  const made = button("", () => show(picture), state);
  made.append(element("span", "name", picture.name), element("span", "mark", text));
  made.title = picture.name;
  return Object.assign(rowOf(made, pressed), { of: picture });
}

function instanceRow(item, chosen, choose, hover) {
  const made = button("", () => choose({ instance: item.id }));
  const score = item.score === null || item.score === undefined ? t("yours") : item.score.toFixed(2);
  made.append(swatch(item.id), element("span", "size", `${(item.width_px ?? 0).toFixed(1)} px`), element("span", "ends", score));
  for (const event of ["pointerenter", "focus"]) made.addEventListener(event, () => hover({ instance: item.id }));
  for (const event of ["pointerleave", "blur"]) made.addEventListener(event, () => hover(null));
  return rowOf(made, chosen?.instance === item.id);
}

function rowOf(made, pressed) {
  made.setAttribute("aria-pressed", String(pressed));
  const row = element("li");
  row.append(made);
  return row;
}
