// Simulated clicks through the viewer's own code: one JSON line of questions in, one of answers out.
// { rgb, map: paths of raw bytes, width, height, clicks: [[x, y], …], pulls: [{ at: [x, y], side }, …], moved }
// → { line, low, high, normals, clicks, mask: pixel indices }
// `moved: { index, to }` is a drag of the line drawn last. With `instance: { centerline_xy, width_px }`, a cable of the
// service, in place of clicks it is that one as the page shows it.

import { createInterface } from "node:readline";
import { readFileSync } from "node:fs";
import { anchors, reclicked, shapeOf } from "../../services/viewer/label_edit.js";
import { prepare } from "../../services/viewer/livewire.js";
import { filled, outlined } from "../../services/viewer/outline.js";
import { paint } from "../../services/viewer/strip.js";

let last = {};
let shape = null;
for await (const row of createInterface({ input: process.stdin })) {
  const { rgb, map, width, height, instance, clicks, pulls, moved } = JSON.parse(row);
  if (last.map !== map) {
    const probability = Float32Array.from(readFileSync(map), (v) => v / 255);
    last = { map, view: { ...prepare(probability, width, height), planes: paint(readFileSync(rgb), width, height) } };
  }
  if (instance) shape = { ...shapeOf(instance), clicks: anchors(instance) };
  else shape = outlined(last.view, moved ? reclicked({ shape: { ...shape, clicks }, width_px: shape.width }, moved.index, moved.to) : clicks, pulls);
  const { line, low, high, normals } = shape;
  console.log(JSON.stringify({ line, low, high, normals, clicks: shape.clicks, mask: filled(shape, width, height) }));
}
