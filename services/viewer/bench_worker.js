// The heavy part of the label bench, off the page's own thread: the picture's pixels, snapping, outlines, masks.

import { finished } from "./label_save.js";
import { trace } from "./livewire.js";
import { outlined, stroke } from "./outline.js";
import { viewOf, withProbability } from "./bench_view.js";

let view = null;

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
