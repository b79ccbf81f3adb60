// Simulated clicks through the viewer's own code: one JSON line of questions in, one of answers out.
// { rgb, map: paths of raw bytes, width, height, clicks: [[x, y], …], pulls: [{ at: [x, y], side }, …], moved, whole, weights }
// → { line, low, high, normals, clicks, pulls, mask: pixel indices }
// `moved: { index, to }` is a drag of the line drawn last, `whole: { by, wider }` one of that cable as a whole. With
// `instance: { centerline_xy, width_px }`, a cable of the service, in place of clicks it is that one as the page shows it.

import { createInterface } from "node:readline";
import { readFileSync } from "node:fs";
import { wholly } from "../../services/viewer/label_drag.js";
import { anchors, reclicked, shapeOf } from "../../services/viewer/label_edit.js";
import { prepare } from "../../services/viewer/livewire.js";
import { filled, outlined, WEIGHTS } from "../../services/viewer/outline.js";
import { paint } from "../../services/viewer/strip.js";

let last = {};
let shape = null;
let edited = false;
let weighed = [null, WEIGHTS]; // what was asked for, and with the page's own beside it: an outline knows them by identity
for await (const row of createInterface({ input: process.stdin })) {
  const { rgb, map, width, height, instance, clicks, pulls, moved, whole, weights = {} } = JSON.parse(row);
  const wanted = JSON.stringify(weights);
  if (weighed[0] !== wanted) weighed = [wanted, Object.freeze({ ...WEIGHTS, ...weights })];
  if (last.map !== map) {
    const probability = Float32Array.from(readFileSync(map), (v) => v / 255);
    last = { map, view: { ...prepare(probability, width, height), planes: paint(readFileSync(rgb), width, height) } };
  }
  if (instance) shape = shapeOf(instance);
  else if (whole) shape = wholly(edited ? { shape } : {}, shape, whole);
  else shape = outlined(last.view, moved ? reclicked({ shape: { ...shape, clicks }, width_px: shape.width }, moved.index, moved.to) : clicks, pulls, weighed[1]);
  edited = !instance;
  const shown = { clicks: anchors(instance ?? { shape }), pulls: shape.pulls };
  const { line, low, high, normals } = shape;
  console.log(JSON.stringify({ line, low, high, normals, ...shown, mask: filled(shape, width, height) }));
}
