// A picture prepared for snapping. Paths are searched on a coarse copy, for their cost grows with its pixels; outlines
// are found in the picture's own.

import { prepare } from "./livewire.js";
import { paint } from "./strip.js";

const WHOLE_PX = 2e6; // pixels up to which a picture is searched as it is
const COARSE_PX = 4e5; // of a larger one's copy: about what the network sees

/** Of a bitmap, shown as large as `size`. Nothing is known of the cables yet. */
export function viewOf(bitmap, { width, height }) {
  const scale = width * height <= WHOLE_PX ? 1 : Math.sqrt((width * height) / COARSE_PX);
  const [w, h] = [width, height].map((side) => Math.max(1, Math.round(side / scale)));
  const coarse = coarseOf(w, h, width / w, height / h);
  coarse.planes = paint(pixels(bitmap, w, h), w, h);
  Object.assign(coarse, prepare(new Float32Array(w * h), w, h));
  const whole = w === width && h === height;
  return { width, height, coarse, bytes: whole ? null : pixels(bitmap, width, height), ...(whole ? coarse : {}) };
}

/** The view with the network's probability, a gray bitmap. */
export function withProbability(view, bitmap) {
  const { width: w, height: h } = view.coarse;
  const seen = pixels(bitmap, w, h);
  const p = new Float32Array(w * h);
  for (let i = 0; i < p.length; i += 1) p[i] = seen[4 * i] / 255;
  const coarse = { ...view.coarse, ...prepare(p, w, h) };
  return { ...view, coarse, traces: null, ...(view.bytes ? {} : coarse) };
}

/** Between both sizes; the center of the top-left pixel is (0, 0) in either. */
function coarseOf(width, height, sx, sy) {
  return {
    width,
    height,
    sx,
    sy,
    inside: ([x, y]) => [(x + 0.5) / sx - 0.5, (y + 0.5) / sy - 0.5],
    outside: ({ line, width: wide }) => ({
      line: line.map(([x, y]) => [(x + 0.5) * sx - 0.5, (y + 0.5) * sy - 0.5]),
      width: wide && wide * Math.sqrt(sx * sy),
    }),
  };
}

function pixels(bitmap, width, height) {
  const sheet = new OffscreenCanvas(width, height).getContext("2d", { willReadFrequently: true });
  sheet.imageSmoothingQuality = "high";
  sheet.drawImage(bitmap, 0, 0, width, height);
  return sheet.getImageData(0, 0, width, height).data;
}
