// From a job to the page that shows it, and to the recipe that repeats it.

import { element } from "./dom.js";
import { t } from "./i18n.js";

const PAGES = {
  instances: "./",
  topology: "viewer/harness.html",
  plan_disentangle: "viewer/harness.html",
  reconstruct: "viewer/reconstruction.html",
};

/** Kinds that a recipe can repeat with other pictures. */
const WITH_PICTURES = new Set(["segment", "instances", "topology", "plan_disentangle", "reconstruct", "label_tracked", "plan_shape"]);

/** A link to the page that draws what a job found, or where nothing can be drawn to its record on the page of the jobs:
 *  the service's own address of it asks for a key that a link cannot carry. */
export function jobLink({ id, kind, state }) {
  const page = (state === "succeeded" && PAGES[kind]) || "viewer/jobs.html";
  return element("a", "mono", id.slice(0, 8), { href: `${page}?job=${id}`, title: id });
}

/** A link to the cables of a job in space, where depth has measured them; else null. */
export function spaceLink({ id, result }) {
  if (!result?.instances?.some(({ curve_m }) => curve_m)) return null;
  return element("a", "button", t("Show in 3D"), { href: `viewer/reconstruction.html?job=${id}` });
}

/** A link to the page that makes a recipe of a finished job; null where there is none. */
export function recipeLink({ id, kind, state }) {
  if (state !== "succeeded" || !WITH_PICTURES.has(kind)) return null;
  return element("a", "button", t("Make a recipe"), { href: `viewer/recipes.html?job=${id}` });
}
