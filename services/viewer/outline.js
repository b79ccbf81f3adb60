// The outline of a cable, found in the picture: of all pairs of smooth lines beside its own, the one that divides cable
// from surroundings best (dynamic programming over the middle and the half width, along the cable). What a person pulls
// at the edges is kept.

import { divided, missed } from "./dividing.js";
import { weighed } from "./evidence.js";
import { normalAt, resample, trace } from "./livewire.js";
import { straightened } from "./strip.js";
import * as whole from "./whole.js";

const USUAL_PX = 10; // a cable's width where nothing is known of it
const FINE_WIDTH_PX = 25; // wider cables are looked at in steps that grow with them
const COARSER = 1.7; // times these steps in all rounds but the last, which only teach the colors
const FINE_LENGTH_PX = 700; // longer ones have no more cuts, further apart
const ROUGH = 2; // times the steps along a cable of a large picture, in these rounds
const KEPT_TRACES = 8;
const ROUNDS = 3; // the colors of the cable are learned from the outline of the round before
export const WEIGHTS = Object.freeze({
  color: 0.9, probability: 0.3, edge: 2.6, // what is seen
  bend: 2, swell: 3.5, prior: 1.7, // against a middle or a width that changes, and a width off the even one
  core: 0.75, beyond: 1.29, far: 2.6, // parts of the half width: surely cable; surely not, from and to
  kinds: 24, clip: 2.5, blend: 0.68, inWindow: 300, outWindow: 27, along: 3, smooth: 3, plain: 0.1, shade: 0.6, // colors; cuts
  rim: 0.35, // pixels beyond the steepest step: what is cable in part is cable to who labels it
  small: 1.5, firm: 30, sure: 100, teach: 10, whole: 0.3, spread: 25, // what a person says
});

/** The cable through `clicks`: `{ line, low, high, normals, width, clicks, pulls }`. `line` runs in its middle; `low` and
 *  `high` are the edges' distances from it along the normal, negative and positive. A pull `{ at, side }` says that the
 *  edge on that side (-1 or 1) passes through `at`, one with `by` moves the whole cable (`whole.js`), its clicks already
 *  with it. `view` is a prepared map with the picture's `planes`. */
export function outlined(view, clicks, pulls = [], weights = WEIGHTS) {
  const move = whole.found(pulls);
  const shape = inPicture(view, clicks.map((at) => whole.minus(at, move.by)), move.pulls, weights);
  return { ...whole.carried(shape, move), clicks, pulls };
}

/** The outline before the whole cable is moved. */
function inPicture(view, clicks, pulls, weights) {
  const path = traced(view, clicks);
  const through = clicks.map((at) => ({ at, side: 0 }));
  const all = [...pulls, ...through];
  if (path.learnedBy !== weights) Object.assign(path, { learned: learned(view, path, through, weights), learnedBy: weights });
  // In a large picture, where somebody would wait, a small pull changes the last round alone.
  const anew = pulls.some((one) => !view.bytes || corrects(one, path.learned, weights));
  return settled(view, anew ? learned(view, path, all, weights) : path.learned, all, weights);
}

/** Whether a pull moves its edge by much of what was learned without it. */
function corrects(one, { line, half, unit }, o) {
  const pin = placed(one, line, line.map((_, i) => normalAt(line, i, 3)));
  return missed(pin, -half[pin.i], half[pin.i]) > apparent(half[pin.i], unit, o);
}

/** By how much an edge may be off before colors are doubted, too. */
const apparent = (half, unit, { small }) => Math.max(small * unit, 0.25 * half);

/** The snapped centerline along all clicks, as `trace` gives it. The view keeps the newest: the line that was traced to
 *  the pointer is asked for again by the click there, and a pull does not change it. */
export function traced(view, clicks) {
  view.traces ??= new Map();
  const key = clicks.map(([x, y]) => `${x.toFixed(3)} ${y.toFixed(3)}`).join(); // clicks that were moved and back are the same
  const known = view.traces.get(key) ?? path(view, clicks);
  view.traces.delete(key);
  view.traces.set(key, known);
  if (view.traces.size > KEPT_TRACES) view.traces.delete(view.traces.keys().next().value);
  return known;
}

/** A large picture's path is searched on its coarse copy. */
function path(view, clicks) {
  const { coarse, bytes } = view;
  return bytes ? coarse.outside(trace(coarse, clicks.map(coarse.inside))) : trace(view, clicks);
}

/** The line and half widths of a cable about `path`, from rounds that teach its colors; `unit` and `apart` are the steps,
 *  across and along, in which it is looked at. A large picture's are larger, and its kinds of color are found from those of
 *  the round before. */
function learned(view, { line: path, width }, pulls, o) {
  const wide = width ?? USUAL_PX;
  const unit = Math.max(1, wide / FINE_WIDTH_PX);
  const apart = 2 * Math.max(unit, lengthOf(path) / FINE_LENGTH_PX);
  const hasty = view.bytes || unit > 1;
  const rough = view.bytes ? ROUGH * apart : apart;
  let line = soft(resample(leaving(path, wide, view), rough), 4);
  let half = line.map(() => wide / 2);
  let centers = null;
  for (let round = 0; round < ROUNDS - 1; round += 1) {
    const { middle, edges, ...seen } = looked(view, { line, half, centers }, pulls, round, hasty ? COARSER * unit : unit, o);
    if (view.bytes) centers = seen.centers;
    line = soft(resample(middle, round < ROUNDS - 2 ? rough : apart), 2);
    half = line.map((_, i) => halfAt(edges, Math.round((i * (middle.length - 1)) / (line.length - 1))));
  }
  return { line, half, centers, unit };
}

/** The last round. */
function settled(view, known, pulls, o) {
  const { middle, edges, normals } = looked(view, known, pulls, ROUNDS - 1, known.unit, o);
  const halves = middle.map((_, i) => halfAt(edges, i));
  const width = 2 * halves.toSorted((a, b) => a - b)[Math.floor(halves.length / 2)];
  return { line: middle, low: halves.map((h) => -h), high: halves, normals, width };
}

/** One round: both edges of every cut, and the middle between them. A pull of side 0 lies somewhere on the cable. */
function looked(view, { line, half, centers: before }, pulls, round, step, o) {
  const strip = straightened(view, line, 2.2 * Math.max(...half) + 8 * step, step / 2);
  const pins = pulls.map((one) => placed(one, line, strip.normals)).filter((pin) => pin.away < strip.r * strip.fine);
  const { edges, centers } = found(strip, half, pins, before, round, step, o);
  const middle = line.map((point, i) => along(point, strip.normals[i], (edges.low[i] + edges.high[i]) / 2));
  return { middle, edges, normals: strip.normals, centers };
}

const halfAt = ({ low, high }, i) => (high[i] - low[i]) / 2;

const lengthOf = (line) => line.reduce((sum, [x, y], i) => (i ? sum + Math.hypot(x - line[i - 1][0], y - line[i - 1][1]) : 0), 0);

/** A line of even width, for what the picture does not show; a pull moves a whole edge. Where the whole cable was moved,
 *  its `clicks` and its `width` are with it. */
export function stroke(clicks, width, pulls = []) {
  const move = whole.found(pulls);
  const line = resample(clicks.map((at) => whole.minus(at, move.by)), 2);
  const normals = line.map((_, i) => normalAt(line, i, 3));
  const half = (width - move.out[0] - move.out[1]) / 2;
  const edges = { low: line.map(() => -half), high: line.map(() => half) };
  pull(edges, move.pulls.map((one) => placed(one, line, normals)), { ...WEIGHTS, whole: 1 });
  return { ...whole.carried({ line, ...edges, normals, width: edges.high[0] - edges.low[0] }, move), clicks, pulls };
}

/** Both edges of every cut in one round; in the last, pulled to where they were asked to be. */
function found(strip, half, pins, before, round, unit, o) {
  const taught = pins.filter((pin) => pin.side).map((pin) => pin.i);
  const evidence = weighed(strip, half, taught, before, o);
  const even = (trust) => (round ? fitted(half, trust) : null);
  const free = divided(strip, evidence, even(evidence.trust), half, [], o);
  const far = pins.filter((pin) => missed(pin, free.low[pin.i], free.high[pin.i]) > apparent(half[pin.i], unit, o));
  const trust = evidence.trust.map((t, i) => (far.some((pin) => pin.side && Math.abs(pin.i - i) <= 2) ? o.sure : t));
  const best = far.length ? divided(strip, evidence, even(trust), half, far, o) : free;
  const edges = { low: refined(strip, evidence, best.low, o), high: refined(strip, evidence, best.high, o) };
  const { centers } = evidence;
  if (round < ROUNDS - 1) return { edges, centers };
  const whole = { low: edges.low.map((t) => t - o.rim), high: edges.high.map((t) => t + o.rim) };
  pull(whole, pins, o);
  return { edges: whole, centers };
}

/** An edge between the samples, where the step is strongest, and smoothed; clear steps count more. */
function refined({ m, r, fine }, { edge, trust }, places, o) {
  const at = places.map((t, i) => i * m + r + Math.round(t / fine));
  const exact = places.map((t, i) => t + fine * peak(edge, at[i]));
  return average(exact, at.map((k, i) => trust[i] * (o.plain + edge[k] ** 2)), o.smooth);
}

/** How far the top of the parabola through the strongest of three samples and its neighbors lies from `k`; 0 where
 *  there is none. */
function peak(values, k) {
  const top = [k - 1, k, k + 1].reduce((best, other) => (values[other] > values[best] ? other : best), k);
  const [before, here, after] = [values[top - 1], values[top], values[top + 1]];
  const bend = before - 2 * here + after;
  return before > here || after > here || !bend ? 0 : top - k + (before - after) / (2 * bend);
}

const along = ([x, y], [nx, ny], t) => [x + t * nx, y + t * ny];

/** The line, longer where it ends at the border: the cable goes on, and its end is cut at a slant. */
function leaving(line, width, view) {
  const on = [...line];
  for (let turn = 0; turn < 2; turn += 1) {
    const [end, before] = [on.at(-1), on[Math.max(0, on.length - 4)]];
    const room = Math.min(end[0], end[1], view.width - 1 - end[0], view.height - 1 - end[1]);
    const length = Math.hypot(end[0] - before[0], end[1] - before[1]);
    if (room < Math.max(2, 0.3 * width) && length) {
      on.push([0, 1].map((axis) => end[axis] + (width * (end[axis] - before[axis])) / length));
    }
    on.reverse();
  }
  return on;
}

/** Where a pull lies: the nearest cut, how far `away` its point on the line is, and how far along the normal. */
function placed({ at, side, wider = 0 }, line, normals) {
  const distances = line.map(([x, y]) => Math.hypot(at[0] - x, at[1] - y));
  const away = Math.min(...distances);
  const i = distances.indexOf(away);
  return { i, away, t: (at[0] - line[i][0]) * normals[i][0] + (at[1] - line[i][1]) * normals[i][1] - side * wider, side };
}

/** Moves the edges through the pins. What is missing there is spread as a Gaussian process would expect it: in part an
 *  error of the whole edge (this person draws wider), in part one of that place. */
export function pull(edges, pins, o = WEIGHTS) {
  const alike = (a, b) => o.whole + (1 - o.whole) * matern((a - b) / o.spread);
  for (const side of [-1, 1]) {
    const edge = side < 0 ? edges.low : edges.high;
    const own = pins.filter((pin) => pin.side === side);
    const matrix = own.map((a) => own.map((b) => alike(a.i, b.i) + (a === b ? 0.01 : 0)));
    const shares = solved(matrix, own.map((pin) => pin.t - edge[pin.i]));
    edge.forEach((_, i) => own.forEach((pin, k) => (edge[i] += shares[k] * alike(i, pin.i))));
  }
}

/** How alike the errors of two places are, that many spreads apart (Matérn's function of order 3/2): a pull makes no cusp,
 *  and is felt far away. */
const matern = (apart) => (1 + Math.sqrt(3) * Math.abs(apart)) * Math.exp(-Math.sqrt(3) * Math.abs(apart));

/** The solution of a positive definite system, by elimination. */
function solved(matrix, values) {
  const rows = matrix.map((row, i) => [...row, values[i]]);
  rows.forEach((pivot, i) => {
    for (const row of rows.slice(i + 1)) {
      const factor = row[i] / pivot[i];
      for (let k = i; k < pivot.length; k += 1) row[k] -= factor * pivot[k];
    }
  });
  const x = new Array(rows.length).fill(0);
  for (let i = rows.length - 1; i >= 0; i -= 1) {
    x[i] = (rows[i].at(-1) - x.reduce((sum, value, k) => sum + rows[i][k] * value, 0)) / rows[i][i];
  }
  return x;
}

/** The straight line through the half widths, few outliers disregarded: a cable gets evenly thinner with distance. */
function fitted(half, trust) {
  let weights = trust;
  let fit = half;
  for (let round = 0; round < 4; round += 1) {
    let [s, sx, sy, sxx, sxy] = [1e-9, 0, 0, 0, 0];
    half.forEach((h, i) => {
      const w = weights[i];
      [s, sx, sy, sxx, sxy] = [s + w, sx + w * i, sy + w * h, sxx + w * i * i, sxy + w * i * h];
    });
    const slope = (s * sxy - sx * sy) / (s * sxx - sx * sx + 1e-9);
    fit = half.map((_, i) => Math.max(1, (sy - slope * sx) / s + slope * i));
    weights = half.map((h, i) => trust[i] / (0.5 + Math.abs(h - fit[i])));
  }
  return fit;
}

/** A weighted Gaussian average along the line. */
function average(values, weights, sigma) {
  const reach = Math.ceil(3 * sigma);
  return values.map((_, i) => {
    let [sum, total] = [0, 0];
    for (let k = Math.max(0, i - reach); k <= Math.min(values.length - 1, i + reach); k += 1) {
      const w = (weights[k] + 1e-3) * Math.exp(-0.5 * ((k - i) / sigma) ** 2);
      sum += w * values[k];
      total += w;
    }
    return sum / total;
  });
}

/** A Gaussian average of the points; near an end it reaches less far, and the ends stay. */
function soft(line, sigma) {
  return line.map((_, i) => {
    const reach = Math.min(Math.ceil(2 * sigma), i, line.length - 1 - i);
    let [x, y, total] = [0, 0, 0];
    for (let k = -reach; k <= reach; k += 1) {
      const w = Math.exp(-0.5 * (k / sigma) ** 2);
      x += w * line[i + k][0];
      y += w * line[i + k][1];
      total += w;
    }
    return [x / total, y / total];
  });
}

/** Indices of the pixels between the two edges; those on a seam of its triangles more than once. */
export function filled({ line, low, high, normals }, columns, rows) {
  const inside = [];
  for (let i = 1; i < line.length; i += 1) {
    const [a, b] = [i - 1, i].map((k) => along(line[k], normals[k], low[k]));
    const [d, c] = [i - 1, i].map((k) => along(line[k], normals[k], high[k]));
    cover(inside, [a, b, c], columns, rows);
    cover(inside, [a, c, d], columns, rows);
  }
  return inside;
}

/** Adds the pixels of a triangle. */
function cover(inside, [[ax, ay], [bx, by], [cx, cy]], columns, rows) {
  const [left, right] = [Math.max(0, Math.ceil(Math.min(ax, bx, cx))), Math.min(columns - 1, Math.floor(Math.max(ax, bx, cx)))];
  const [top, bottom] = [Math.max(0, Math.ceil(Math.min(ay, by, cy))), Math.min(rows - 1, Math.floor(Math.max(ay, by, cy)))];
  for (let y = top; y <= bottom; y += 1) {
    for (let x = left; x <= right; x += 1) {
      const p = (bx - ax) * (y - ay) - (by - ay) * (x - ax);
      const q = (cx - bx) * (y - by) - (cy - by) * (x - bx);
      const s = (ax - cx) * (y - cy) - (ay - cy) * (x - cx);
      if ((p >= 0 && q >= 0 && s >= 0) || (p <= 0 && q <= 0 && s <= 0)) inside.push(y * columns + x);
    }
  }
}
