// The masks of what nobody edited on the label bench, as one picture from the worker. Most edits leave them as they are:
// a large picture's masks take longer to draw than an outline to find.

import { ask } from "./bench_calls.js";

export class Tint {
  #of = []; // the instances whose masks are drawn, or being drawn
  #drawn = null;

  /** `arrived()` is called when other masks are there. */
  constructor(arrived) {
    this.arrived = arrived;
  }

  /** The masks of a label, `{ bitmap, width, height }`, or null: until new ones are drawn, those before. */
  of(label) {
    const wanted = (label?.instances ?? []).filter((item) => !item.shape && item.mask_rle);
    if (!same(wanted, this.#of)) this.#draw(wanted, label);
    return this.#drawn;
  }

  #draw(instances, label) {
    const before = this.#of;
    this.#of = instances;
    // Of another picture, or of a label without any, nothing is to be seen meanwhile.
    if (!instances.some((item) => before.some((other) => alike(item, other)))) this.#drawn = null;
    if (!instances.length) return;
    const { width, height } = label;
    const slim = instances.map(({ id, mask_rle }) => ({ id, mask_rle }));
    ask("masks", { width, height, instances: slim }).then((drawn) => {
      if (this.#of !== instances) return;
      this.#drawn = drawn;
      this.arrived();
    }, () => {}); // lines are enough to go on with
  }
}

// A step that was kept in the database comes back as other objects.
const alike = (one, other) => one === other
  || (one.id === other.id && one.mask_rle.size[0] === other.mask_rle.size[0] && one.mask_rle.counts === other.mask_rle.counts);
const same = (some, others) => some.length === others.length && some.every((item, k) => alike(item, others[k]));
