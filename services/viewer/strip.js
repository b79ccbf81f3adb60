// What a picture says along a line: the strip around it, cut out and straightened, and for every place in it how much
// looks like this cable, how strong the step across is, and which cuts show another cable on top.

import { normalAt, sample } from "./livewire.js";

const KMEANS_ROUNDS = 8;
const KMEANS_SAMPLES = 3000;
const CELLS = 128; // of two levels each, along brightness and both color differences
const SHADOWS = [0.85, 0.7, 0.55]; // of the light, that is left in a shadow

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
  const each = (take) => line.forEach(([x, y], i) => {
    for (let k = 0; k < m; k += 1) {
      const t = (k - r) * fine;
      take(i * m + k, x + t * normals[i][0], y + t * normals[i][1]);
    }
  });
  const made = () => new Float32Array(line.length * m);
  const [colors, p] = [[made(), made(), made()], made()];
  const { coarse } = view;
  if (view.bytes) {
    each((at, x, y) => {
      painted(colors, at, view, x, y);
      p[at] = sample(coarse.p, coarse, ...coarse.inside([x, y]));
    });
  } else {
    [...view.planes, view.p].forEach((plane, c) => {
      const out = colors[c] ?? p;
      each((at, x, y) => (out[at] = sample(plane, view, x, y)));
    });
  }
  return { n: line.length, m, r, fine, normals, colors, p };
}

/** As `paint` and `sample` do it, for one place and from RGBA bytes: the planes of a large picture take too much room. */
function painted([light, red, yellow], at, { bytes, width, height }, x, y) {
  const [cx, cy] = [Math.max(0, Math.min(width - 1.001, x)), Math.max(0, Math.min(height - 1.001, y))];
  const [u, v] = [Math.floor(cx), Math.floor(cy)];
  const [a, b, i, row] = [cx - u, cy - v, 4 * (v * width + u), 4 * width];
  const of = (c) => {
    const k = i + c;
    return (1 - b) * ((1 - a) * bytes[k] + a * bytes[k + 4]) + b * ((1 - a) * bytes[k + row] + a * bytes[k + row + 4]);
  };
  const [r, g, blue] = [of(0), of(1), of(2)];
  light[at] = (r + g + blue) / 3;
  red[at] = (r - g) / 2;
  yellow[at] = (r + g) / 4 - blue / 2;
}

/** `gain`: what speaks for a sample being cable, `half` being the half widths so far and `taught` the cuts at which a
 *  person has shown the edges; `edge`: the strength of the step
 *  there, 0 to 1; `trust`: of every cut, low where what lies between the edges does not look like this cable. */
export function weighed(strip, half, taught, o) {
  const { n, m, r, fine, p } = strip;
  const { kinds, shadows } = sorted(strip, o);
  const part = (i, k) => (Math.abs(k - r) * fine) / half[i];
  const rows = half.map((_, i) => 1 + o.teach * Math.max(0, ...taught.map((at) => Math.exp(-(((i - at) / 8) ** 2)))));
  const inside = shares(strip, kinds, o, o.inWindow, rows, (i, k) => part(i, k) < o.core);
  const outside = shares(strip, kinds, o, o.outWindow, rows, (i, k) => part(i, k) > o.beyond && part(i, k) < o.far).map(shadows);
  const gain = new Float32Array(n * m);
  const trust = new Float32Array(n);
  for (let i = 0; i < n; i += 1) {
    const ratio = inside[i].map((share, kind) => Math.max(-o.clip, Math.min(o.clip, Math.log(share / outside[i][kind]))));
    let [own, count] = [0, 0];
    for (let k = 0; k < m; k += 1) {
      const q = Math.min(0.95, Math.max(0.05, p[i * m + k]));
      gain[i * m + k] = o.color * ratio[kinds[i * m + k]] + o.probability * Math.log(q / (1 - q));
      if (part(i, k) > 0.7) continue;
      own += ratio[kinds[i * m + k]] > -0.5 ? 1 : 0;
      count += 1;
    }
    trust[i] = own > 0.5 * count ? 1 : 0.1;
  }
  return { gain, edge: stepped(strip, o.along), trust };
}

/** The kind of color of every sample, by k-means; and `shadows`: shares of kinds on the ground, to those where a part of
 *  the ground lies in shadow, which darkens a color and keeps its tone. */
function sorted({ n, m, colors: [light, red, yellow] }, { kinds: count, shade }) {
  const total = n * m;
  const stride = Math.max(1, Math.floor(total / KMEANS_SAMPLES));
  const few = Array.from({ length: Math.floor(total / stride) }, (_, i) => i * stride);
  const bright = [...few].sort((a, b) => light[a] - light[b]);
  const centers = new Float64Array(3 * count);
  for (let k = 0; k < count; k += 1) {
    const i = bright[Math.floor(((k + 0.5) * bright.length) / count)];
    centers.set([light[i], red[i], yellow[i]], 3 * k);
  }
  const alike = (a, b, c) => {
    let best = 0;
    let least = Infinity;
    for (let at = 0; at < 3 * count; at += 3) {
      const x = a - centers[at];
      const y = b - centers[at + 1];
      const z = c - centers[at + 2];
      const d = x * x + 2 * (y * y + z * z); // light changes along a cable more than its color does
      if (d < least) {
        best = at;
        least = d;
      }
    }
    return best / 3;
  };
  const nearest = (i) => alike(light[i], red[i], yellow[i]);
  for (let round = 0; round < KMEANS_ROUNDS; round += 1) {
    const [sums, counts] = [new Float64Array(3 * count), new Float64Array(count)];
    for (const i of few) {
      const k = nearest(i);
      counts[k] += 1;
      sums[3 * k] += light[i];
      sums[3 * k + 1] += red[i];
      sums[3 * k + 2] += yellow[i];
    }
    sums.forEach((sum, at) => counts[Math.floor(at / 3)] && (centers[at] = sum / counts[Math.floor(at / 3)]));
  }
  const darker = Array.from({ length: count }, (_, k) => SHADOWS.map((part) => alike(...centers.subarray(3 * k, 3 * k + 3).map((value) => part * value))));
  const shadows = (ground) => {
    const made = ground.map((share) => (1 - shade) * share);
    darker.forEach((kinds, k) => kinds.forEach((kind) => (made[kind] += (shade * ground[k]) / SHADOWS.length)));
    return made;
  };
  return { kinds: named(light, red, yellow, alike), shadows };
}

/** The kind of every sample, looked for once in each cell of two levels a side: most samples have a neighbor's color. */
function named(light, red, yellow, alike) {
  const cells = new Uint8Array(CELLS ** 3); // a kind and one; 0 where nobody has looked
  const cell = (value) => Math.max(0, Math.min(CELLS - 1, value >> 1));
  const kinds = new Uint8Array(light.length);
  for (let i = 0; i < kinds.length; i += 1) {
    const [a, b, c] = [cell(light[i]), cell(red[i] + 128), cell(yellow[i] + 128)];
    const at = (a * CELLS + b) * CELLS + c;
    if (!cells[at]) cells[at] = 1 + alike(2 * a + 1, 2 * b - 127, 2 * c - 127);
    kinds[i] = cells[at] - 1;
  }
  return kinds;
}

/** For every cut the shares of the kinds among the samples that `belongs` takes, within `window` cuts to either side,
 *  blended with those of the whole strip; `weights` of the cuts. */
function shares({ n, m }, kinds, o, window, weights, belongs) {
  const whole = new Float64Array(o.kinds).fill(0.5);
  const rows = Array.from({ length: n }, (_, i) => {
    const row = new Float64Array(o.kinds);
    for (let k = 0; k < m; k += 1) if (belongs(i, k)) row[kinds[i * m + k]] += weights[i];
    row.forEach((count, kind) => (whole[kind] += count));
    return row;
  });
  const all = whole.reduce((a, b) => a + b);
  const near = new Float64Array(o.kinds);
  let [from, to] = [0, 0];
  return rows.map((_, i) => {
    for (; to < Math.min(n, i + window + 1); to += 1) rows[to].forEach((count, kind) => (near[kind] += count));
    for (; from < i - window; from += 1) rows[from].forEach((count, kind) => (near[kind] -= count));
    const sum = near.reduce((a, b) => a + b) || 1;
    return near.map((count, kind) => (1 - o.blend) * (count / sum) + o.blend * (whole[kind] / all) + 2e-3);
  });
}

/** Strength of the step across the cable at every sample, from colors averaged over `along` cuts to either side; 1 is
 *  as strong as the strongest step of the usual cut. */
function stepped({ n, m, colors }, along) {
  const squared = new Float32Array(n * m);
  for (const plane of colors) {
    const mean = averaged(plane, n, m, along);
    for (let i = 0; i < n; i += 1) {
      for (let k = 2; k < m - 2; k += 1) squared[i * m + k] += (mean[i * m + k + 2] - mean[i * m + k - 2]) ** 2;
    }
  }
  const tops = Array.from({ length: n }, (_, i) => squared.subarray(i * m, (i + 1) * m).reduce((a, b) => Math.max(a, b), 0));
  const usual = Math.sqrt(tops.sort((a, b) => a - b)[Math.floor(n / 2)]) || 1;
  return squared.map((s) => Math.min(1, Math.sqrt(s) / usual));
}

function averaged(plane, n, m, along) {
  const mean = new Float32Array(n * m);
  for (let k = 0; k < m; k += 1) {
    let [sum, from, to] = [0, 0, 0];
    for (let i = 0; i < n; i += 1) {
      for (; to < Math.min(n, i + along + 1); to += 1) sum += plane[to * m + k];
      for (; from < i - along; from += 1) sum -= plane[from * m + k];
      mean[i * m + k] = sum / (to - from);
    }
  }
  return mean;
}
