// What a click on the label bench waits for, off the page's own thread: the picture's pixels, snapping, outlines.

import { outlined, stroke, traced } from "./outline.js";
import { viewOf, withProbability } from "./bench_view.js";
import { answer } from "./worker_answers.js";

const WARM_SIZES = [[1800, 1200], [600, 200]];
const WARM_TURNS = 4;

let view = null;
let known = { asked: null, shape: null }; // the last outline: most are asked for ahead, and again when they are wanted

answer({
  open: ({ bitmap, size }) => look(viewOf(bitmap, size)),
  probability: ({ bitmap }) => look(withProbability(view, bitmap)),
  trace: ({ points }) => traced(view, points).line,
  shape: ({ clicks, pulls, width, snaps }) => (snaps ? outline(clicks, pulls) : stroke(clicks, width, pulls)),
});
warm();

function look(next) {
  view = next;
  known = { asked: null, shape: null };
}

function outline(clicks, pulls) {
  const asked = JSON.stringify([clicks, pulls]);
  if (known.asked !== asked) known = { asked, shape: outlined(view, clicks, pulls) };
  return known.shape;
}

/** Outlines drawn cables before anybody asks for one: the first outlines wait for the compiler, half a second. It has to
 *  see what is to come, a large picture with and without a probability and a small one, or it begins anew. Who asks
 *  meanwhile comes first, and from the first line on that is the better practice. */
async function warm() {
  const [large, small] = WARM_SIZES.map(([width, height]) => drawn(width, height));
  const [wide, narrow] = [large, small].map((picture) => viewOf(picture, picture));
  const views = [wide, withProbability(wide, large), withProbability(narrow, small)];
  for (let turn = 0; turn < WARM_TURNS; turn += 1) {
    for (const view of views) {
      const { width, height } = view;
      const clicks = [0.15, 0.85].map((share) => [share * width, height / 2 + turn]);
      for (const pulls of [[], [{ at: [width / 2, height / 2 + 12], side: 1 }]]) {
        await new Promise((resume) => setTimeout(resume));
        if (known.asked) return;
        outlined({ ...view, traces: null }, clicks, pulls);
      }
    }
  }
}

/** A picture of one cable. */
function drawn(width, height) {
  const sheet = new OffscreenCanvas(width, height);
  const context = sheet.getContext("2d");
  context.fillStyle = "#555";
  context.fillRect(0, 0, width, height);
  context.fillStyle = "#c84";
  context.fillRect(0, height / 2 - 10, width, 20);
  return sheet;
}
