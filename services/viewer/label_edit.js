// A label under correction: plain functions from one label to the next, so that undo is keeping the old ones.
// A label is `{ name, width, height, instances, crossings, … }` as in dlo-label/1; an edited instance has a `shape`, as
// `outlined` gives it. Beside its cables it may have areas to ignore and connectors (polygons), and branch-points.

import { stroke } from "./outline.js";

const SAME_PLACE_PX = 15;
const ANCHOR_PX = 150; // between the points that stand for the clicks of a line that nobody clicked; they hold its errors, too
const SAME_CLICK_PX = 20;
const STRETCH = 16; // pieces of a line that are looked at together
const even = new WeakMap(); // instance that nobody edited → its shape

/** A new instance on top of the others. */
export function add(label, shape) {
  const id = 1 + Math.max(0, ...label.instances.map((i) => i.id));
  return crossed({ ...label, instances: [...label.instances, drawn(label, id, shape)] });
}

/** The instance with another shape. */
export const reshape = (label, id, shape) => replaced(label, id, () => [drawn(label, id, shape)]);

export const remove = (label, id) => replaced(label, id, () => []);

/** Two instances from one, cut at the `index`-th point of its line; the second gets a new id. */
export function split(label, id, index) {
  const next = 1 + Math.max(...label.instances.map((i) => i.id));
  return replaced(label, id, (old) => {
    const shape = shapeOf(old);
    if (index < 1 || index > shape.line.length - 2) return [old];
    const [first, second] = [part(shape, 0, index + 1), part(shape, index, shape.line.length)];
    return [drawn(label, id, first), drawn(label, next, second)];
  });
}

/** An instance's shape; one that nobody edited is as wide everywhere. It is asked for at every move of a pointer. */
export function shapeOf(instance) {
  if (instance.shape) return instance.shape;
  if (!even.has(instance)) even.set(instance, stroke(instance.centerline_xy, instance.width_px));
  return even.get(instance);
}

/** Points `from` to `to` of a shape, its clicks forgotten. */
export function part(shape, from, to) {
  const [line, low, high, normals] = [shape.line, shape.low, shape.high, shape.normals].map((all) => all.slice(from, to));
  return { ...shape, line, low, high, normals, clicks: null, pulls: [] };
}

/** The clicks of one instance from two, joined by their nearest ends; null where it cannot be. */
export function joined(label, first, second) {
  const [a, b] = [first, second].map((id) => label.instances.find((i) => i.id === id));
  if (!a || !b || a === b) return null;
  const [p, q] = [anchors(a), anchors(b)];
  const ways = [[p, q], [p, q.toReversed()], [p.toReversed(), q], [p.toReversed(), q.toReversed()]];
  const gap = ([head, tail]) => Math.hypot(head.at(-1)[0] - tail[0][0], head.at(-1)[1] - tail[0][1]);
  const [head, tail] = ways.reduce((best, way) => (gap(way) < gap(best) ? way : best));
  return [...head, ...tail];
}

/** One instance of two, with the `shape` found for their clicks. */
export const merge = (label, first, second, shape) => reshape(remove(label, second), first, shape);

/** The clicks of an instance; of one that nobody clicked, points along it. */
export function anchors({ shape, centerline_xy }) {
  if (shape?.clicks) return shape.clicks;
  const line = shape?.line ?? centerline_xy;
  const at = lengths(line);
  const count = Math.max(1, Math.round(at.at(-1) / ANCHOR_PX));
  return Array.from({ length: count + 1 }, (_, k) => line[at.findIndex((s) => s >= (at.at(-1) * k) / count - 1e-9)]);
}

/** The clicks with one more where the line was grabbed at its `index`-th point, or the one near it moved. An end that is
 *  moved back along its line takes the clicks with it that it passes. */
export function reclicked(instance, index, to) {
  const line = instance.shape?.line ?? instance.centerline_xy;
  const at = lengths(line);
  const clicks = anchors(instance);
  let from = 0;
  const places = clicks.map((click) => {
    const away = line.map((point, i) => (i < from ? Infinity : Math.hypot(point[0] - click[0], point[1] - click[1])));
    from = away.indexOf(Math.min(...away));
    return at[from];
  });
  const gaps = places.map((place) => Math.abs(place - at[index]));
  const near = gaps.indexOf(Math.min(...gaps));
  if (gaps[near] < SAME_CLICK_PX) {
    const back = placeOn(line, at, to, instance.width_px) ?? at[index];
    const last = clicks.length - 1;
    const passed = (k) => k > 0 && k < last && ((!near && places[k] <= back) || (near === last && places[k] >= back));
    return clicks.with(near, to).filter((_, k) => !passed(k));
  }
  const before = places.filter((place) => place < at[index]).length;
  return clicks.toSpliced(before, 0, to);
}

/** How far along the line a point within `reach` of it lies; null for one that is further away. */
function placeOn(line, at, [x, y], reach) {
  const away = line.map((point) => Math.hypot(point[0] - x, point[1] - y));
  const least = Math.min(...away);
  return least < reach ? at[away.indexOf(least)] : null;
}

/** One more area or branch-point; `list` is `ignore`, `connectors` or `branch_points`. */
export const mark = (label, list, drawn) => ({ ...label, [list]: [...(label[list] ?? []), drawn] });

export const unmark = (label, list, index) => ({ ...label, [list]: label[list].toSpliced(index, 1) });

/** The other strand on top. */
export function swap(label, crossingId) {
  const crossing = label.crossings.find((c) => c.id === crossingId);
  if (!crossing) return label;
  const turned = { ...crossing, over: crossing.under, under: crossing.over, score: 1 };
  const strands = [crossing.over.instance, crossing.under.instance];
  return {
    ...label,
    crossings: label.crossings.map((c) => (c === crossing ? turned : c)),
    instances: label.instances.map((i) => (strands.includes(i.id) ? { ...i, edited: true } : i)),
  };
}

function drawn({ width, height }, id, shape) {
  // A shape goes on a little beyond the border.
  const inside = shape.line.filter(([x, y]) => x > -0.5 && y > -0.5 && x < width - 0.5 && y < height - 0.5);
  const line = inside.length > 1 ? inside : shape.line;
  return {
    id, score: null, centerline_xy: line.map(([x, y]) => [round(x), round(y)]), width_px: round(shape.width), closed: false,
    mask_rle: null, spline: null, endpoints: [], length_px: round(lengths(line).at(-1)), edited: true, shape,
  };
}

const round = (value) => Math.round(value * 100) / 100;

function replaced(label, id, change) {
  return crossed({ ...label, instances: label.instances.flatMap((i) => (i.id === id ? change(i) : [i])) });
}

/** Crossings anew for edited instances; the order of those that were there is kept. A new one has the later
 *  instance on top, and score 0.5: nobody has looked at it. */
function crossed(label) {
  const edited = new Set(label.instances.filter((i) => i.edited).map((i) => i.id));
  const present = new Set(label.instances.map((i) => i.id));
  const involved = (c, set) => set.has(c.over.instance) || set.has(c.under.instance);
  const kept = label.crossings.filter((c) => !involved(c, edited) && present.has(c.over.instance) && present.has(c.under.instance));
  const found = [];
  label.instances.forEach((a, k) => {
    for (const b of label.instances.slice(k + 1)) {
      if (edited.has(a.id) || edited.has(b.id)) found.push(...meetings(a, b));
    }
  });
  const ordered = found.map((c) => {
    const old = label.crossings.find((o) => Math.hypot(o.xy[0] - c.xy[0], o.xy[1] - c.xy[1]) < SAME_PLACE_PX);
    const upside = old && old.over.instance === c.under.instance && old.under.instance === c.over.instance;
    const same = old && old.over.instance === c.over.instance && old.under.instance === c.under.instance;
    return upside ? { ...c, over: c.under, under: c.over, score: old.score } : { ...c, score: same ? old.score : 0.5 };
  });
  return { ...label, crossings: [...kept, ...ordered].map((c, k) => ({ ...c, id: k + 1 })) };
}

function meetings(a, b) {
  const [at, bt] = [lengths(a.centerline_xy), lengths(b.centerline_xy)];
  const found = [];
  for (const [i, j] of neighbors(a.centerline_xy, b.centerline_xy)) {
    const hit = meeting(a.centerline_xy[i - 1], a.centerline_xy[i], b.centerline_xy[j - 1], b.centerline_xy[j]);
    if (!hit) continue;
    const u = (at[i - 1] + hit.t * (at[i] - at[i - 1])) / at.at(-1);
    const v = (bt[j - 1] + hit.u * (bt[j] - bt[j - 1])) / bt.at(-1);
    found.push({ xy: hit.xy.map(round), over: { instance: b.id, u: v }, under: { instance: a.id, u } });
  }
  return found;
}

/** The pieces of two lines, by the index of their second point, that are in stretches whose boxes overlap. */
function* neighbors(one, other) {
  for (const a of stretches(one)) {
    for (const b of stretches(other)) {
      if (a.left > b.right || b.left > a.right || a.top > b.bottom || b.top > a.bottom) continue;
      for (let i = a.from; i < a.to; i += 1) for (let j = b.from; j < b.to; j += 1) yield [i, j];
    }
  }
}

function stretches(line) {
  return Array.from({ length: Math.ceil((line.length - 1) / STRETCH) }, (_, k) => {
    const [from, to] = [1 + k * STRETCH, Math.min(line.length, 1 + (k + 1) * STRETCH)];
    const [xs, ys] = [0, 1].map((axis) => line.slice(from - 1, to).map((point) => point[axis]));
    return { from, to, left: Math.min(...xs), right: Math.max(...xs), top: Math.min(...ys), bottom: Math.max(...ys) };
  });
}

function meeting([ax, ay], [bx, by], [cx, cy], [dx, dy]) {
  const area = (bx - ax) * (dy - cy) - (by - ay) * (dx - cx);
  if (!area) return null;
  const t = ((cx - ax) * (dy - cy) - (cy - ay) * (dx - cx)) / area;
  const u = ((cx - ax) * (by - ay) - (cy - ay) * (bx - ax)) / area;
  return t >= 0 && t < 1 && u >= 0 && u < 1 ? { t, u, xy: [ax + t * (bx - ax), ay + t * (by - ay)] } : null;
}

function lengths(points) {
  const at = [0];
  for (let i = 1; i < points.length; i += 1) {
    at.push(at[i - 1] + Math.hypot(points[i][0] - points[i - 1][0], points[i][1] - points[i - 1][1]));
  }
  return at;
}
