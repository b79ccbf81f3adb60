// The heavy part of the label bench, off the page's own thread: the picture's pixels, snapping, outlines, masks.

import { finished } from "./label_save.js";
import { prepare } from "./livewire.js";
import { outlined, stroke, traced } from "./outline.js";
import { paint } from "./strip.js";
import { viewOf, withProbability } from "./bench_view.js";

let view = null;
warm();

const CALLS = {
  open: ({ bitmap, size }) => void (view = viewOf(bitmap, size)),
  probability: ({ bitmap }) => void (view = withProbability(view, bitmap)),
  trace: ({ points }) => traced(view, points).line,
  shape: ({ clicks, pulls, width, snaps }) => (snaps ? outlined(view, clicks, pulls) : stroke(clicks, width, pulls)),
  finish: ({ label, confirmed }) => finished(label, confirmed),
};

addEventListener("message", ({ data: { id, call, values } }) => {
  try {
    postMessage({ id, result: CALLS[call](values) });
  } catch (error) {
    postMessage({ id, error: error.message });
  }
});

/** Outlines a drawn cable before anybody asks for one, as in a large picture and in a small one: the first outlines would
 *  wait for the compiler, half a second. */
function warm() {
  const [width, height] = [400, 100];
  const bytes = new Uint8ClampedArray(4 * width * height).map((_, i) => (Math.abs(Math.floor(i / (4 * width)) - 50) < 6 ? 180 : 60 + (i % 7)));
  const drawn = { ...prepare(new Float32Array(width * height), width, height), planes: paint(bytes, width, height) };
  const coarse = { ...drawn, sx: 1, sy: 1, inside: (at) => at, outside: (one) => one };
  for (const view of [{ width, height, bytes, coarse }, { ...drawn, coarse: drawn, bytes: null }]) {
    for (const x of [370, 371, 372]) outlined(view, [[10, 50], [x, 50]], [{ at: [200, 56], side: 1 }]);
  }
}
