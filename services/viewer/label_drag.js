// What a drag on an instance means: one edge; with Shift both edges apart, the width; from the middle a little, both
// edges together; from the middle further, the line to another place. With Ctrl the same all along the cable: one edge,
// from the middle all of it, with both keys its width.

import { anchors, reclicked } from "./label_edit.js";
import { normalAt } from "./livewire.js";
import { pull } from "./outline.js";
import { carried, outOf, plus } from "./whole.js";

const INNER_PART = 0.5; // of the half width, where a drag takes the line and not an edge
const BRUSH_PX = 40; // how much of a line is shown to come along, in picture pixels to either side

/** A drag that begins at `from`, near the `index`-th point of the instance's `shape`, with Shift held for `both` edges,
 *  with Ctrl for the `whole` cable. */
export function grabbed(instance, shape, index, from, both, whole = false) {
  const t = across(shape, index, [from[0] - shape.line[index][0], from[1] - shape.line[index][1]]);
  const side = t > INNER_PART * shape.high[index] ? 1 : t < INNER_PART * shape.low[index] ? -1 : 0;
  return { instance, shape, index, from, side, both, whole };
}

/** The shape as it looks meanwhile. */
export function dragged(drag, to) {
  const { shape, index, from } = drag;
  if (drag.whole) return wholly(drag.instance, shape, moveOf(drag, to));
  if (!reroutes(drag, to)) {
    const edges = { low: [...shape.low], high: [...shape.high] };
    pull(edges, pins(drag, to));
    return { ...shape, ...edges };
  }
  const line = shape.line.map(([x, y]) => {
    const weight = Math.exp(-((Math.hypot(x - shape.line[index][0], y - shape.line[index][1]) / BRUSH_PX) ** 2));
    return [x + weight * (to[0] - from[0]), y + weight * (to[1] - from[1])];
  });
  return { ...shape, line };
}

/** The shape that the instance has then, if it was moved as a whole, else its clicks and pulls. */
export function dropped(drag, to) {
  const { instance, shape, index, from } = drag;
  if (drag.whole) return { shape: wholly(instance, shape, moveOf(drag, to)) };
  const [x, y] = shape.line[index];
  const pulls = shape.pulls ?? [];
  if (reroutes(drag, to)) return { clicks: reclicked(instance, index, [x + to[0] - from[0], y + to[1] - from[1]]), pulls };
  const [nx, ny] = shape.normals[index];
  const more = pins(drag, to).map(({ t, side }) => ({ at: [x + t * nx, y + t * ny], side }));
  return { clicks: anchors(instance), pulls: [...pulls, ...more] };
}

/** A shape moved as a whole. One that was not found by its clicks keeps none: an outline found later is another. */
export function wholly({ shape: own }, shape, move) {
  const clicks = own?.clicks?.map((at) => plus(at, move.by)) ?? null;
  return { ...carried(shape, { ...move, out: outOf(move) }), clicks, pulls: clicks ? [...(shape.pulls ?? []), move] : [] };
}

function moveOf({ shape, index, from, side, both }, to) {
  const by = [to[0] - from[0], to[1] - from[1]];
  if (!side && !both) return { by, wider: 0 };
  const wider = (side || 1) * across(shape, index, by);
  return { by: [0, 0], wider, ...(both ? {} : { side }) };
}

function reroutes({ shape, index, from, side }, to) {
  return !side && Math.hypot(to[0] - from[0], to[1] - from[1]) > shape.high[index];
}

function pins({ shape, index, from, side, both }, to) {
  const by = across(shape, index, [to[0] - from[0], to[1] - from[1]]);
  const moves = { "-1": side > 0 ? (both ? -by : null) : by, 1: side < 0 ? (both ? -by : null) : by };
  return [[-1, shape.low], [1, shape.high]]
    .filter(([which]) => moves[which] !== null)
    .map(([which, edge]) => ({ i: index, t: edge[index] + moves[which], side: which }));
}

function across({ line }, index, [dx, dy]) {
  const [nx, ny] = normalAt(line, index, 3);
  return dx * nx + dy * ny;
}
