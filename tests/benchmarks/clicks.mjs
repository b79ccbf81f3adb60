// Simulated clicks through the viewer's own code: one JSON line of questions in, one of answers out.
// { rgb, map: paths of raw bytes, width, height, clicks: [[x, y], …], pulls: [{ at: [x, y], side }, …] }
// → { line, low, high, normals, mask: pixel indices }

import { createInterface } from "node:readline";
import { readFileSync } from "node:fs";
import { prepare } from "../../services/viewer/livewire.js";
import { filled, outlined } from "../../services/viewer/outline.js";
import { paint } from "../../services/viewer/strip.js";

let last = {};
for await (const row of createInterface({ input: process.stdin })) {
  const { rgb, map, width, height, clicks, pulls } = JSON.parse(row);
  if (last.map !== map) {
    const probability = Float32Array.from(readFileSync(map), (v) => v / 255);
    last = { map, view: { ...prepare(probability, width, height), planes: paint(readFileSync(rgb), width, height) } };
  }
  const { line, low, high, normals } = outlined(last.view, clicks, pulls);
  const mask = filled({ line, low, high, normals }, width, height);
  console.log(JSON.stringify({ line, low, high, normals, mask }));
}
