// What a picture shows along a line: the strip around it, cut out and straightened.

import { normalAt } from "./livewire.js";

/** RGB or RGBA bytes as brightness and two color differences, each a Float32Array. */
export function paint(bytes, width, height) {
  const channels = bytes.length / (width * height);
  const planes = [0, 1, 2].map(() => new Float32Array(width * height));
  for (let i = 0; i < width * height; i += 1) {
    const [r, g, b] = [bytes[channels * i], bytes[channels * i + 1], bytes[channels * i + 2]];
    planes[0][i] = (r + g + b) / 3;
    planes[1][i] = (r - g) / 2;
    planes[2][i] = (r + g) / 4 - b / 2;
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
  const { coarse } = view;
  const colors = view.bytes ? painted(view, places) : view.planes.map((plane) => sampled(plane, view, places));
  const p = view.bytes ? sampled(coarse.p, coarse, insideOf(coarse, places)) : sampled(view.p, view, places);
  return { n: line.length, m, r, fine, normals, colors, p };
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

/** A plane between its samples at all places; beyond its border, the border's. */
function sampled(plane, { width, height }, places) {
  const out = new Float32Array(places.length / 2);
  for (let at = 0; at < out.length; at += 1) {
    const x = Math.max(0, Math.min(width - 1.001, places[2 * at]));
    const y = Math.max(0, Math.min(height - 1.001, places[2 * at + 1]));
    const u = Math.floor(x);
    const v = Math.floor(y);
    const a = x - u;
    const b = y - v;
    const i = v * width + u;
    const upper = (1 - a) * plane[i] + a * plane[i + 1];
    const lower = (1 - a) * plane[i + width] + a * plane[i + width + 1];
    out[at] = (1 - b) * upper + b * lower;
  }
  return out;
}

/** As `paint` and `sampled` do it, from RGBA bytes: the planes of a large picture take too much room. */
function painted({ bytes, width, height }, places) {
  const [light, red, yellow] = [0, 1, 2].map(() => new Float32Array(places.length / 2));
  const row = 4 * width;
  for (let at = 0; at < light.length; at += 1) {
    const x = Math.max(0, Math.min(width - 1.001, places[2 * at]));
    const y = Math.max(0, Math.min(height - 1.001, places[2 * at + 1]));
    const u = Math.floor(x);
    const v = Math.floor(y);
    const a = x - u;
    const b = y - v;
    const i = 4 * (v * width + u);
    const [r, g, blue] = [channel(bytes, i, row, a, b), channel(bytes, i + 1, row, a, b), channel(bytes, i + 2, row, a, b)];
    light[at] = (r + g + blue) / 3;
    red[at] = (r - g) / 2;
    yellow[at] = (r + g) / 4 - blue / 2;
  }
  return [light, red, yellow];
}

const channel = (bytes, i, row, a, b) =>
  (1 - b) * ((1 - a) * bytes[i] + a * bytes[i + 4]) + b * ((1 - a) * bytes[i + row] + a * bytes[i + row + 4]);
