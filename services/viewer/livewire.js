// A line that snaps to the centerline of a cable: the cheapest path over the service's foreground probability
// between two clicks, then every point moved to the middle of the cable, and the width measured on the way.

const SIDE_PX = 30; // how far a path may leave the box around its two clicks
const SPACING_PX = 4;
const STEPS = [[1, 0, 1], [-1, 0, 1], [0, 1, 1], [0, -1, 1], [1, 1, Math.SQRT2], [1, -1, Math.SQRT2], [-1, 1, Math.SQRT2], [-1, -1, Math.SQRT2]];

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

/** The snapped centerline along all clicks: `{ line, width, taper }`, as `settle` gives it. A click `[x, y, true]` is
 *  exact: the line passes through it, and its neighborhood moves along. */
export function trace(map, clicks) {
  const path = [clicks[0].slice(0, 2)];
  for (let i = 1; i < clicks.length; i += 1) path.push(...cheapest(map, clicks[i - 1], clicks[i]).slice(1));
  const found = settle(map, path);
  return { ...found, line: pinned(found.line, clicks.filter(([, , exact]) => exact)) };
}

/** The line through all `pins`; between two of them their displacements are blended, beyond the outer ones kept. */
function pinned(line, pins) {
  const moves = pins.map(([x, y]) => {
    const distances = line.map(([a, b]) => Math.hypot(a - x, b - y));
    const index = distances.indexOf(Math.min(...distances));
    return { index, by: [x - line[index][0], y - line[index][1]] };
  });
  if (!moves.length) return line;
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
 *  widths seen, `taper` that near its start and its end: a cable that runs away from the camera gets thinner. */
export function settle(map, path) {
  let line = smooth(resample(path, SPACING_PX), 2);
  let width = null;
  let taper = null;
  for (let round = 0; round < 2; round += 1) {
    const cuts = line.map((point, i) => crossSection(map, point, normalAt(line, i)));
    const seen = cuts.filter(Boolean).map((cut) => cut.width).sort((a, b) => a - b);
    if (!seen.length) return { line, width: null, taper: null };
    width = median(seen);
    taper = tapered(cuts, width);
    line = line.map(([x, y], i) => {
      const cut = cuts[i];
      // Where two cables touch, the cut through both has its middle between them.
      if (!cut || cut.width > 1.5 * width) return [x, y];
      const [nx, ny] = normalAt(line, i);
      return [x + cut.middle * nx, y + cut.middle * ny];
    });
    line = smooth(line, 1);
  }
  return { line, width, taper };
}

const median = (values) => [...values].sort((a, b) => a - b)[Math.floor(values.length / 2)];

/** Widths at both ends of the straight line through the medians of the first and the second half. */
function tapered(cuts, width) {
  const usable = cuts.map((cut, i) => [i, cut?.width]).filter(([, w]) => w && w < 1.5 * width && w > 0.5 * width);
  const halves = [usable.filter(([i]) => i < cuts.length / 2), usable.filter(([i]) => i >= cuts.length / 2)];
  if (halves.some((half) => half.length < 4)) return [width, width];
  const [[i, a], [j, b]] = halves.map((half) => [0, 1].map((k) => median(half.map((pair) => pair[k]))));
  const slope = (b - a) / (j - i);
  const bound = (w) => Math.max(0.6 * width, Math.min(1.6 * width, w));
  return [bound(a - slope * i), bound(a + slope * (cuts.length - 1 - i))];
}

/** Indices of the cable's pixels. Where the map sees the cable it is the foreground near the line, so that the label
 *  follows the contour; elsewhere, and without a map, a stroke whose width goes from `taper[0]` to `taper[1]`. */
export function body(map, line, taper, columns, rows) {
  const found = new Set();
  const seen = map ? line.map((point, i) => crossSection(map, point, normalAt(line, i))) : [];
  for (let i = 1; i < line.length; i += 1) {
    const [a, b] = [seen[i - 1], seen[i]];
    const width = taper[0] + ((taper[1] - taper[0]) * (i - 0.5)) / (line.length - 1);
    const follows = a && b && a.width < 1.6 * width && b.width < 1.6 * width;
    const half = Math.max(width / 2, 0.5);
    for (const at of near(line[i - 1], line[i], follows ? 1.5 * half : half, columns, rows)) {
      if (!follows || map.p[at] >= 0.5) found.add(at);
    }
  }
  return found;
}

/** Indices of the pixels within `half` of a segment. */
function* near([ax, ay], [bx, by], half, columns, rows) {
  const [left, right] = [Math.max(0, Math.ceil(Math.min(ax, bx) - half)), Math.min(columns - 1, Math.floor(Math.max(ax, bx) + half))];
  const [top, bottom] = [Math.max(0, Math.ceil(Math.min(ay, by) - half)), Math.min(rows - 1, Math.floor(Math.max(ay, by) + half))];
  const squared = (bx - ax) ** 2 + (by - ay) ** 2;
  for (let y = top; y <= bottom; y += 1) {
    for (let x = left; x <= right; x += 1) {
      const t = squared ? Math.max(0, Math.min(1, ((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / squared)) : 0;
      if (Math.hypot(x - ax - t * (bx - ax), y - ay - t * (by - ay)) <= half) yield y * columns + x;
    }
  }
}

/** Pixels from one click to the next, both included. */
export function cheapest(map, from, to) {
  const side = SIDE_PX + 0.25 * Math.hypot(to[0] - from[0], to[1] - from[1]);
  const clamp = (v, most) => Math.max(0, Math.min(most, Math.round(v)));
  const left = clamp(Math.min(from[0], to[0]) - side, map.width - 1);
  const top = clamp(Math.min(from[1], to[1]) - side, map.height - 1);
  const w = clamp(Math.max(from[0], to[0]) + side, map.width - 1) - left + 1;
  const h = clamp(Math.max(from[1], to[1]) + side, map.height - 1) - top + 1;
  const at = ([x, y]) => (clamp(y, map.height - 1) - top) * w + clamp(x, map.width - 1) - left;
  const [start, goal] = [at(from), at(to)];
  const reached = new Float64Array(w * h).fill(Infinity);
  const before = new Int32Array(w * h).fill(-1);
  const open = new Heap();
  reached[start] = 0;
  open.push(start, 0);
  while (open.size) {
    const [i, cost] = open.pop();
    if (i === goal) break;
    if (cost > reached[i]) continue;
    const [x, y] = [i % w, Math.floor(i / w)];
    for (const [dx, dy, length] of STEPS) {
      if (x + dx < 0 || x + dx >= w || y + dy < 0 || y + dy >= h) continue;
      const j = i + dy * w + dx;
      const next = cost + length * price(map, x + dx + left, y + dy + top);
      if (next < reached[j]) {
        [reached[j], before[j]] = [next, i];
        open.push(j, next);
      }
    }
  }
  const path = [];
  for (let i = goal; i >= 0; i = before[i]) path.push([(i % w) + left, Math.floor(i / w) + top]);
  return path.reverse();
}

function price(map, x, y) {
  const i = y * map.width + x;
  return 0.05 + 3 * (1 - map.p[i]) ** 2 + 0.6 / (1 + map.depth[i]);
}

/** Where the cut along `normal` through `point` crosses the cable: `{ middle, width }` in pixels, or null. */
function crossSection(map, [x, y], [nx, ny]) {
  const inside = (t) => sample(map, x + t * nx, y + t * ny) >= 0.5;
  let start = null;
  for (const t of [0, 1, -1, 2, -2, 3, -3, 4, -4]) {
    if (start === null && inside(t)) start = t;
  }
  if (start === null) return null;
  const edge = (direction) => {
    let t = start;
    while (Math.abs(t - start) < 60 && inside(t + direction)) t += direction;
    const [a, b] = [sample(map, x + t * nx, y + t * ny), sample(map, x + (t + direction) * nx, y + (t + direction) * ny)];
    return t + direction * Math.max(0, Math.min(1, (a - 0.5) / (a - b || 1)));
  };
  const [low, high] = [edge(-1), edge(1)];
  return { middle: (low + high) / 2, width: high - low };
}

function sample(map, x, y) {
  if (x < 0 || y < 0 || x > map.width - 1 || y > map.height - 1) return 0;
  const [u, v] = [Math.min(Math.floor(x), map.width - 2), Math.min(Math.floor(y), map.height - 2)];
  const [a, b, i] = [x - u, y - v, v * map.width + u];
  const { p, width } = map;
  return (1 - b) * ((1 - a) * p[i] + a * p[i + 1]) + b * ((1 - a) * p[i + width] + a * p[i + width + 1]);
}

function normalAt(line, i) {
  const [a, b] = [line[Math.max(0, i - 2)], line[Math.min(line.length - 1, i + 2)]];
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

class Heap {
  #items = [];
  #keys = [];

  get size() {
    return this.#items.length;
  }

  push(item, key) {
    let at = this.#items.length;
    while (at > 0) {
      const parent = (at - 1) >> 1;
      if (this.#keys[parent] <= key) break;
      [this.#items[at], this.#keys[at]] = [this.#items[parent], this.#keys[parent]];
      at = parent;
    }
    [this.#items[at], this.#keys[at]] = [item, key];
  }

  pop() {
    const first = [this.#items[0], this.#keys[0]];
    const [item, key] = [this.#items.pop(), this.#keys.pop()];
    const count = this.#items.length;
    if (!count) return first;
    let at = 0;
    for (;;) {
      let child = 2 * at + 1;
      if (child >= count) break;
      if (child + 1 < count && this.#keys[child + 1] < this.#keys[child]) child += 1;
      if (this.#keys[child] >= key) break;
      [this.#items[at], this.#keys[at]] = [this.#items[child], this.#keys[child]];
      at = child;
    }
    [this.#items[at], this.#keys[at]] = [item, key];
    return first;
  }
}
