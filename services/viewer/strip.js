// What a picture shows along a line: the strip around it, cut out and straightened.

import { normalAt } from "./livewire.js";

/** RGB or RGBA bytes as brightness and two color differences, each a Float32Array. */
export function paint(bytes, width, height) {
  const channels = bytes.length / (width * height);
  const planes = [0, 1, 2].map(() => new Float32Array(width * height));
  planes.forEach((plane, c) => {
    for (let i = 0; i < plane.length; i += 1) plane[i] = bytes[channels * i + c];
  });
  return opposed(planes);
}

/** Red, green and blue to brightness and two color differences, in place. */
function opposed(planes) {
  const [first, second, third] = planes;
  for (let i = 0; i < first.length; i += 1) {
    const r = first[i];
    const g = second[i];
    const b = third[i];
    first[i] = (r + g + b) / 3;
    second[i] = (r - g) / 2;
    third[i] = (r + g) / 4 - b / 2;
  }
  return planes;
}

/** `n` cuts across the line of `m` samples each, `fine` pixels apart, the line at sample `r`: `colors`, probability
 *  `p`, and the `normals` along which the cuts run. */
export function straightened(view, line, reach, fine) {
  const r = Math.ceil(reach / fine);
  const m = 2 * r + 1;
  const normals = line.map((_, i) => normalAt(line, i, 3));
  const places = new Float64Array(2 * line.length * m);
  for (let i = 0, at = 0; i < line.length; i += 1) {
    const [[x, y], [nx, ny]] = [line[i], normals[i]];
    for (let k = -r; k <= r; k += 1, at += 2) {
      places[at] = x + k * fine * nx;
      places[at + 1] = y + k * fine * ny;
    }
  }
  return { n: line.length, m, r, fine, normals, ...seen(view, places) };
}

/** Colors and probability at all places. The planes of a large picture would take too much room: its colors are read
 *  from its RGBA bytes, its probability from the coarse copy. */
function seen(view, places) {
  const { bytes, coarse, planes, p } = view;
  const spots = located(view, places);
  if (!bytes) return { colors: planes.map((plane) => sampled(plane, spots)), p: sampled(p, spots) };
  const colors = opposed([0, 1, 2].map((channel) => sampled(bytes, spots, 4, channel)));
  return { colors, p: sampled(coarse.p, located(coarse, insideOf(coarse, places))) };
}

/** The places in the coarse copy. */
function insideOf({ sx, sy }, places) {
  const inside = new Float64Array(places.length);
  for (let at = 0; at < places.length; at += 2) {
    inside[at] = (places[at] + 0.5) / sx - 0.5;
    inside[at + 1] = (places[at + 1] + 0.5) / sy - 0.5;
  }
  return inside;
}

/** Between which pixels the places lie: the upper left one, and how far `right` and `down` of it; beyond the border, on it. */
function located({ width, height }, places) {
  const corners = new Int32Array(places.length / 2);
  const [right, down] = [new Float64Array(corners.length), new Float64Array(corners.length)];
  for (let at = 0; at < corners.length; at += 1) {
    const x = Math.max(0, Math.min(width - 1.001, places[2 * at]));
    const y = Math.max(0, Math.min(height - 1.001, places[2 * at + 1]));
    corners[at] = Math.floor(y) * width + Math.floor(x);
    right[at] = x - Math.floor(x);
    down[at] = y - Math.floor(y);
  }
  return { corners, right, down, width };
}

/** One of the values that every pixel has, between the pixels. */
function sampled(values, { corners, right, down, width }, channels = 1, channel = 0) {
  const out = new Float32Array(corners.length);
  const row = channels * width;
  for (let at = 0; at < out.length; at += 1) {
    const a = right[at];
    const b = down[at];
    const i = channels * corners[at] + channel;
    const upper = (1 - a) * values[i] + a * values[i + channels];
    const lower = (1 - a) * values[i + row] + a * values[i + row + channels];
    out[at] = (1 - b) * upper + b * lower;
  }
  return out;
}
