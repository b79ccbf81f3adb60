// Simulated clicks through the viewer's own live wire: one JSON line a trace in, one out.
// { map: path of a raw byte map, width, height, clicks: [[x, y], …] } → { line, masks: [along the contour, stroke] }

import { createInterface } from "node:readline";
import { readFileSync } from "node:fs";
import { body, prepare, trace } from "../../services/viewer/livewire.js";

let last = {};
for await (const row of createInterface({ input: process.stdin })) {
  const { map, width, height, clicks } = JSON.parse(row);
  if (last.map !== map) {
    last = { map, prepared: prepare(Float32Array.from(readFileSync(map), (v) => v / 255), width, height) };
  }
  const found = trace(last.prepared, clicks);
  const masks = [last.prepared, null].map((seen) => [...body(seen, found.line, found.taper ?? [6, 6], width, height)]);
  console.log(JSON.stringify({ line: found.line, masks }));
}
