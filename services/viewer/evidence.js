// What in a strip speaks for a cable: how much every place in it looks like this one, how strong the step across is, and
// which cuts show another cable on top.

import { sorted } from "./kinds.js";

const BODY = 0.7; // of the half width, within which a cut must look like the cable to be trusted
const DOUBT = 0.05; // the probability of neither is less
const SURE = Math.log((1 - DOUBT) / DOUBT);

/** `gain`: what speaks for a sample being cable, `half` being the half widths so far and `taught` the cuts at which a
 *  person has shown the edges; `edge`: the strength of the step there, 0 to 1; `trust`: of every cut, low where what lies
 *  between the edges does not look like this cable; `centers` of its kinds of color, found from those `before`. */
export function weighed(strip, half, taught, before, o) {
  const { kinds, shadows, centers } = sorted(strip, o, before);
  const weights = half.map((_, i) => 1 + o.teach * Math.max(0, ...taught.map((at) => Math.exp(-(((i - at) / 8) ** 2)))));
  const inside = shares(counted(strip, kinds, half, weights, -Infinity, o.core, o), o.inWindow, o);
  const outside = shares(counted(strip, kinds, half, weights, o.beyond, o.far, o), o.outWindow, o).map(shadows);
  return { ...judged(strip, kinds, half, inside, outside, o), edge: stepped(strip, o.along), centers };
}

/** `gain` and `trust` by the shares of the kinds inside and outside, and by the probability. */
function judged({ n, m, r, fine, p }, kinds, half, inside, outside, o) {
  const gain = new Float32Array(n * m);
  const trust = new Float32Array(n);
  for (let i = 0; i < n; i += 1) {
    const ratio = inside[i].map((share, kind) => Math.max(-o.clip, Math.min(o.clip, Math.log(share / outside[i][kind]))));
    let own = 0;
    let count = 0;
    for (let k = 0, at = i * m; k < m; k += 1, at += 1) {
      const speaks = ratio[kinds[at]];
      gain[at] = o.color * speaks + o.probability * logOdds(p[at]);
      if ((Math.abs(k - r) * fine) / half[i] > BODY) continue;
      if (speaks > -0.5) own += 1;
      count += 1;
    }
    trust[i] = own > 0.5 * count ? 1 : 0.1;
  }
  return { gain, trust };
}

/** Most places are surely cable or surely not: they need no logarithm. */
function logOdds(p) {
  if (p <= DOUBT) return -SURE;
  return p >= 1 - DOUBT ? SURE : Math.log(p / (1 - p));
}

/** For every cut the `weights` of its samples of each kind that are `from` to `to` half widths off the line. */
function counted({ n, m, r, fine }, kinds, half, weights, from, to, o) {
  return Array.from({ length: n }, (_, i) => {
    const row = new Float64Array(o.kinds);
    const reach = Math.ceil((to * half[i]) / fine);
    for (let k = Math.max(0, r - reach); k < Math.min(m, r + reach + 1); k += 1) {
      const part = (Math.abs(k - r) * fine) / half[i];
      if (part > from && part < to) row[kinds[i * m + k]] += weights[i];
    }
    return row;
  });
}

/** For every cut the shares of the kinds within `window` cuts to either side, blended with those of the whole strip. */
function shares(rows, window, { kinds, blend }) {
  const whole = new Float64Array(kinds).fill(0.5);
  for (const row of rows) for (let kind = 0; kind < kinds; kind += 1) whole[kind] += row[kind];
  const all = whole.reduce((a, b) => a + b);
  const near = new Float64Array(kinds);
  const shift = (row, sign) => {
    for (let kind = 0; kind < kinds; kind += 1) near[kind] += sign * row[kind];
  };
  let [from, to] = [0, 0];
  return rows.map((_, i) => {
    for (; to < Math.min(rows.length, i + window + 1); to += 1) shift(rows[to], 1);
    for (; from < i - window; from += 1) shift(rows[from], -1);
    const sum = near.reduce((a, b) => a + b) || 1;
    return near.map((count, kind) => (1 - blend) * (count / sum) + blend * (whole[kind] / all) + 2e-3);
  });
}

/** Strength of the step across the cable at every sample, from colors averaged over `along` cuts to either side; 1 is
 *  as strong as the strongest step of the usual cut. */
function stepped({ n, m, colors }, along) {
  const squared = new Float32Array(n * m);
  for (const plane of colors) {
    const mean = averaged(plane, n, m, along);
    for (let i = 0; i < n; i += 1) {
      for (let at = i * m + 2; at < (i + 1) * m - 2; at += 1) {
        const step = mean[at + 2] - mean[at - 2];
        squared[at] += step * step;
      }
    }
  }
  const tops = Array.from({ length: n }, (_, i) => {
    let top = 0;
    for (let at = i * m; at < (i + 1) * m; at += 1) if (squared[at] > top) top = squared[at];
    return top;
  });
  const usual = Math.sqrt(tops.sort((a, b) => a - b)[Math.floor(n / 2)]) || 1;
  for (let at = 0; at < squared.length; at += 1) squared[at] = Math.min(1, Math.sqrt(squared[at]) / usual);
  return squared;
}

/** The mean over `along` cuts to either side, for every sample. */
function averaged(plane, n, m, along) {
  const mean = new Float32Array(n * m);
  const sums = new Float64Array(m);
  let [from, to] = [0, 0];
  for (let i = 0; i < n; i += 1) {
    for (; to < Math.min(n, i + along + 1); to += 1) added(sums, plane, to * m, 1);
    for (; from < i - along; from += 1) added(sums, plane, from * m, -1);
    for (let k = 0; k < m; k += 1) mean[i * m + k] = sums[k] / (to - from);
  }
  return mean;
}

function added(sums, plane, from, sign) {
  for (let k = 0; k < sums.length; k += 1) sums[k] += sign * plane[from + k];
}
