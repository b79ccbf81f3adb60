// The heavy part of the label bench, off the page's own thread: the picture's pixels, snapping, outlines, masks.

import { finished } from "./label_save.js";
import { prepare, trace } from "./livewire.js";
import { outlined, stroke } from "./outline.js";
import { paint } from "./strip.js";
import { viewOf, withProbability } from "./bench_view.js";

let view = null;
warm();

const CALLS = {
  open: ({ bitmap, size }) => void (view = viewOf(bitmap, size)),
  probability: ({ bitmap }) => void (view = withProbability(view, bitmap)),
  trace: ({ points }) => traced(points),
  shape: ({ clicks, pulls, width, snaps }) => (snaps ? outlined(view, clicks, pulls) : stroke(clicks, width, pulls)),
  finish: ({ label, confirmed }) => finished(label, confirmed),
};

function traced(points) {
  const { coarse } = view;
  return coarse.outside(trace(coarse, points.map(coarse.inside))).line;
}

addEventListener("message", ({ data: { id, call, values } }) => {
  try {
    postMessage({ id, result: CALLS[call](values) });
  } catch (error) {
    postMessage({ id, error: error.message });
  }
});

/** Outlines a drawn cable before anybody asks for one: the first outline would wait for the compiler, half a second. */
function warm() {
  const [width, height] = [240, 60];
  const bytes = new Uint8ClampedArray(4 * width * height).map((_, i) => (Math.abs(Math.floor(i / (4 * width)) - 30) < 6 ? 180 : 60 + (i % 7)));
  const drawn = { width, height, bytes: null, planes: paint(bytes, width, height), ...prepare(new Float32Array(width * height), width, height) };
  for (const x of [220, 221, 222]) outlined({ ...drawn, coarse: drawn }, [[10, 30], [x, 30]], [{ at: [100, 36], side: 1 }]);
}
