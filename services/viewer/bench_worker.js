// What a click on the label bench waits for, off the page's own thread: the picture's pixels, snapping, outlines.

import { outlined, stroke, traced } from "./outline.js";
import { viewOf, withProbability } from "./bench_view.js";
import { answer } from "./worker_answers.js";

const WARM_SIZES = [[1800, 1200], [600, 200]];

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

/** Outlines a drawn cable before anybody asks for one: the first outlines wait for the compiler, half a second. It has to
 *  see what is to come, a large picture with and without a probability and a small one, or it begins anew. Who asks
 *  meanwhile comes first, and from the first line on that is the better practice. More of it would be in the way of the
 *  picture that is opened. */
async function warm() {
  const [large, small] = WARM_SIZES.map(([width, height]) => drawn(width, height));
  const [wide, narrow] = [large, small].map((picture) => viewOf(picture, picture));
  for (const view of [wide, withProbability(wide, large), withProbability(narrow, small)]) {
    const { width, height } = view;
    for (const pulls of [[], [{ at: [width / 2, height / 2 + 12], side: 1 }]]) {
      await new Promise((resume) => setTimeout(resume));
      if (known.asked) return;
      outlined(view, [[0.15 * width, height / 2], [0.85 * width, height / 2]], pulls);
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
