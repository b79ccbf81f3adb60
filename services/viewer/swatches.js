// The number of a cable on its color.

import { element } from "./dom.js";
import { color, inkOn } from "./colors.js";

export function swatch(id) {
  const made = element("i", "swatch", String(id));
  Object.assign(made.style, { background: color(id), color: inkOn(id) });
  return made;
}
