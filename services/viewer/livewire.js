// A line that snaps to the centerline of a cable: the cheapest path between two clicks, over the service's foreground
// probability and what has the color of the clicks, then every point moved to the middle of the cable.

import { cheapest, likely, searchable } from "./search.js";

const SPACING_PX = 4;

/** `{ p, depth, width, height }` of a probability map (Float32Array, row by row): `depth` is a pixel's distance to
 *  the background, by which the middle of a wide cable is cheaper than its edge. */
export function prepare(p, width, height) {
  const depth = new Float32Array(p.length);
  for (let i = 0; i < p.length; i += 1) depth[i] = p[i] >= 0.5 ? 1e4 : 0;
  const relax = (i, x, y, dx, dy, cost) => {
    if (x + dx < 0 || x + dx >= width || y + dy < 0 || y + dy >= height) return;
    depth[i] = Math.min(depth[i], depth[i + dy * width + dx] + cost);
  };
  const pass = (x, y, s) => {
    const i = y * width + x;
    if (!depth[i]) return;
    relax(i, x, y, -s, 0, 1);
    relax(i, x, y, 0, -s, 1);
    relax(i, x, y, -s, -s, Math.SQRT2);
    relax(i, x, y, s, -s, Math.SQRT2);
  };
  for (let y = 0; y < height; y += 1) for (let x = 0; x < width; x += 1) pass(x, y, 1);
  for (let y = height - 1; y >= 0; y -= 1) for (let x = width - 1; x >= 0; x -= 1) pass(x, y, -1);
  return { p, depth, width, height };
}

/** The snapped centerline along all clicks: `{ line, width }`, as `settle` gives it. `view` is a prepared map with the
 *  picture's `planes`. */
export function trace(view, clicks) {
  const map = searchable(view, clicks);
  const path = [clicks[0]];
  for (let i = 1; i < clicks.length; i += 1) path.push(...cheapest(map, clicks[i - 1], clicks[i]).slice(1));
  const { line, width } = settle(map, path);
  return { line: through(line, clicks, 0.2 * (width ?? 0)), width };
}

/** The line moved so that it passes within `slack` of every click: where cables lie side by side, the map's middle is
 *  between them. Between two clicks their moves are blended, beyond the outer ones kept. */
function through(line, clicks, slack) {
  const moves = clicks.map(([x, y]) => {
    const distances = line.map(([a, b]) => Math.hypot(a - x, b - y));
    const away = Math.min(...distances);
    const index = distances.indexOf(away);
    const share = away > slack ? 1 - slack / away : 0;
    return { index, by: [share * (x - line[index][0]), share * (y - line[index][1])] };
  });
  moves.sort((a, b) => a.index - b.index);
  return line.map((point, i) => {
    const after = moves.find((move) => move.index >= i) ?? moves.at(-1);
    const before = moves.findLast((move) => move.index <= i) ?? moves[0];
    const span = after.index - before.index;
    const share = span ? (i - before.index) / span : 0;
    return point.map((value, axis) => value + (1 - share) * before.by[axis] + share * after.by[axis]);
  });
}

/** The line moved to the middle of the cable, smoothed; where no cable is seen it stays. `width` is the median of the
 *  widths seen, or null. */
function settle(map, path) {
  let line = smooth(resample(path, SPACING_PX), 2);
  let width = null;
  for (let round = 0; round < 2; round += 1) {
    const cuts = line.map((point, i) => crossSection(map, point, normalAt(line, i, 2)));
    const seen = cuts.filter(Boolean).map((cut) => cut.width).sort((a, b) => a - b);
    if (!seen.length) return { line, width: null };
    width = seen[Math.floor(seen.length / 2)];
    line = line.map(([x, y], i) => {
      const cut = cuts[i];
      // Where two cables touch, the cut through both has its middle between them.
      if (!cut || cut.width > 1.5 * width) return [x, y];
      const [nx, ny] = normalAt(line, i, 2);
      return [x + cut.middle * nx, y + cut.middle * ny];
    });
    line = smooth(line, 1);
  }
  return { line, width };
}

/** Where the cut along `normal` through `point` crosses the cable: `{ middle, width }` in pixels, or null. */
function crossSection(map, [x, y], [nx, ny]) {
  const seen = (t) => (within(map, x + t * nx, y + t * ny) ? between(map, x + t * nx, y + t * ny) : 0);
  const inside = (t) => seen(t) >= 0.5;
  let start = null;
  for (const t of [0, 1, -1, 2, -2, 3, -3, 4, -4]) {
    if (start === null && inside(t)) start = t;
  }
  if (start === null) return null;
  const edge = (direction) => {
    let t = start;
    while (Math.abs(t - start) < 60 && inside(t + direction)) t += direction;
    const [a, b] = [seen(t), seen(t + direction)];
    return t + direction * Math.max(0, Math.min(1, (a - 0.5) / (a - b || 1)));
  };
  const [low, high] = [edge(-1), edge(1)];
  return { middle: (low + high) / 2, width: high - low };
}

/** What is likely at a place between pixels. */
function between(map, x, y) {
  const [u, v] = [Math.floor(x), Math.floor(y)];
  const [a, b, i] = [x - u, y - v, v * map.width + u];
  const at = (k, share) => (share > 0 ? share * likely(map, k) : 0);
  return at(i, (1 - a) * (1 - b)) + at(i + 1, a * (1 - b)) + at(i + map.width, (1 - a) * b) + at(i + map.width + 1, a * b);
}

const within = ({ width, height }, x, y) => x >= 0 && y >= 0 && x <= width - 1 && y <= height - 1;

/** The unit normal of a line at its `i`-th point, from the points `reach` before and after. */
export function normalAt(line, i, reach) {
  const [a, b] = [line[Math.max(0, i - reach)], line[Math.min(line.length - 1, i + reach)]];
  const length = Math.hypot(b[0] - a[0], b[1] - a[1]) || 1;
  return [-(b[1] - a[1]) / length, (b[0] - a[0]) / length];
}

/** Points at equal arc length about `spacing` apart, both ends included. */
export function resample(points, spacing) {
  if (points.length < 2) return [points[0], points[0]];
  const at = [0];
  for (let i = 1; i < points.length; i += 1) {
    at.push(at[i - 1] + Math.hypot(points[i][0] - points[i - 1][0], points[i][1] - points[i - 1][1]));
  }
  const total = at[at.length - 1];
  const count = Math.max(1, Math.round(total / spacing));
  const out = [];
  for (let k = 0, i = 1; k <= count; k += 1) {
    const wanted = (total * k) / count;
    while (i < points.length - 1 && at[i] < wanted) i += 1;
    const share = at[i] > at[i - 1] ? (wanted - at[i - 1]) / (at[i] - at[i - 1]) : 0;
    out.push([0, 1].map((axis) => points[i - 1][axis] + share * (points[i][axis] - points[i - 1][axis])));
  }
  return out;
}

/** A moving average over `reach` points to either side; near the ends it reaches less far, and the ends stay. */
function smooth(line, reach) {
  return line.map((_, i) => {
    const r = Math.min(reach, i, line.length - 1 - i);
    const near = line.slice(i - r, i + r + 1);
    return [0, 1].map((axis) => near.reduce((sum, point) => sum + point[axis], 0) / near.length);
  });
}
