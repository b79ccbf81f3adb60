// The number of a cable on its color.

import { element } from "./dom.js";
import { color, rgb } from "./overlay.js";

const LIGHT = 0.18; // luminance from which black stands out better than white

/** Black or white, whichever is read better on the color of an instance. */
export function inkOn(id) {
  const [r, g, b] = rgb(id).map((value) => (value / 255) ** 2.2);
  return 0.2126 * r + 0.7152 * g + 0.0722 * b > LIGHT ? "#000" : "#fff";
}

export function swatch(id) {
  const made = element("i", "swatch", String(id));
  Object.assign(made.style, { background: color(id), color: inkOn(id) });
  return made;
}
