// The tools of the label bench: what a press, a drag or a key does to the label shown. Edits follow one another, each
// when the one before is done, for outlines are found by the worker.

import { ask, traceLive } from "./bench_calls.js";
import { box } from "./bench_draw.js";
import { dropped, grabbed } from "./label_drag.js";
import { add, joined, mark, merge, remove, reshape, shapeOf, split, swap, unmark } from "./label_edit.js";

const NEAR_PX = 12; // on the screen
const USUAL_PX = 6; // the width of a line that does not snap
const REST_MS = 80; // of the pointer in a drag, after which the outline there is asked for ahead
const MARKS = { ignore: "ignore", connector: "connectors", branch: "branch_points" };

export class Tools {
  tool = "add";
  snaps = true;
  clicks = [];
  trace = null; // the line through the clicks and the pointer
  ahead = null; // the outline of the clicks so far
  drag = null;
  pointer = null;
  hovered = null;
  chosen = null;
  #resting = 0;
  #last = Promise.resolve();
  #pending = 0;
  #opening = false;

  /** `changed()` when something is to be drawn anew; `failed(error)`. */
  constructor(bench, stage, changed, failed) {
    Object.assign(this, { bench, stage, changed, failed });
  }

  take(tool) {
    this.tool = tool;
    this.drop();
  }

  /** Forgets what was begun. */
  drop() {
    Object.assign(this, { clicks: [], trace: null, ahead: null, drag: null, chosen: null });
    if (this.bench.shown?.clicks?.length) this.bench.note(this.bench.shown, { clicks: [] });
    this.changed();
  }

  /** What was begun in a picture that is shown again. */
  resume() {
    const { shown } = this.bench;
    Object.assign(this, { clicks: shown?.clicks ?? [], trace: null, ahead: null, drag: null, hovered: null, chosen: null });
  }

  press(event) {
    const label = this.bench.label();
    if (!label) return;
    const at = this.stage.toPicture(event);
    const near = this.#nearest(at);
    if (this.tool === "move" && near) {
      this.drag = grabbed(near.instance, shapeOf(near.instance), near.index, at, event.shiftKey, event.ctrlKey || event.metaKey);
      this.chosen = { instance: near.instance.id };
    } else if (this.tool === "connector" && !this.clicks.length) {
      this.clicks = [at];
      this.drag = { box: true };
    } else this.#click(at, near);
    this.changed();
  }

  move(event) {
    const label = this.bench.label();
    if (!label) return;
    this.pointer = this.stage.toPicture(event);
    this.hovered = this.#under(this.pointer);
    if (this.tool === "add" && this.clicks.length) this.#traceOn();
    if (this.drag?.instance) this.#rest(this.drag, this.pointer);
    this.changed();
  }

  release(event) {
    const { drag } = this;
    this.drag = null;
    clearTimeout(this.#resting);
    if (!drag) return;
    const to = this.stage.toPicture(event);
    if (drag.box) {
      this.clicks.push(to);
      this.finish();
    } else if (away(drag.from, to) >= 0.1) this.#moved(drag, to);
    this.changed();
  }

  leave() {
    Object.assign(this, { pointer: null, hovered: null });
    this.changed();
  }

  /** Ends the line or the area that was begun. True if there was one. */
  finish() {
    const { clicks, tool } = this;
    if (!clicks.length) return false;
    Object.assign(this, { clicks: [], trace: null, ahead: null });
    const far = clicks.some((one) => away(one, clicks[0]) > 1);
    // What becomes an edit stays noted until that is kept.
    if (!far && this.bench.shown) this.bench.note(this.bench.shown, { clicks: [] });
    if (tool === "add" && far) this.#edit(async (label) => add(label, await this.#shape(clicks, [])));
    if (tool === "ignore" && clicks.length > 2) this.#edit((label) => mark(label, "ignore", rounded(clicks)));
    if (tool === "connector" && far) this.#edit((label) => mark(label, "connectors", rounded(box(clicks))));
    this.changed();
    return true;
  }

  /** A second finger came: the first one was no click. */
  undoTouch() {
    this.drag = null;
    if (this.clicks.length) this.back();
  }

  back() {
    this.clicks = this.clicks.slice(0, -1);
    this.trace = null;
    this.#note();
    this.#lookAhead();
  }

  deleteChosen() {
    const what = this.chosen;
    if (!what) return;
    this.chosen = null;
    this.#edit((label) => without(label, what));
  }

  /** Chooses the next thing of the label, or the one before. */
  chooseNext(by) {
    const all = this.bench.label()?.instances.map(({ id }) => id) ?? [];
    if (!all.length) return;
    const at = all.indexOf(this.chosen?.instance);
    this.chosen = { instance: all[(at + by + all.length) % all.length] };
    this.changed();
  }

  swapChosen() {
    const at = this.hovered?.crossing ?? this.chosen?.crossing;
    if (at) this.#edit((label) => swap(label, at));
  }

  /** Tells whether a picture is being opened: until it is, lines snap to less than they could. */
  opens(now) {
    this.#opening = now;
    this.#tellBusy();
  }

  /** Resolves when all edits so far are done. */
  settled = () => this.#last;

  #click(at, near) {
    const under = this.#under(at);
    if (this.tool === "add" || this.tool === "ignore") {
      this.clicks = [...this.clicks, at];
      this.#note();
      this.#lookAhead();
    } else if (this.tool === "split" && near) {
      this.#edit((label) => split(label, near.instance.id, near.index));
    } else if (this.tool === "join") this.#join(near?.instance.id);
    else if (this.tool === "delete" && under) this.#edit((label) => without(label, under));
    else if (this.tool === "swap" && under?.crossing) this.#edit((label) => swap(label, under.crossing));
    else if (this.tool === "branch") this.#edit((label) => mark(label, "branch_points", rounded([at])[0]));
    else this.chosen = under;
  }

  #join(id) {
    const first = this.chosen?.instance;
    if (!id || !first || id === first) this.chosen = id ? { instance: id } : null;
    else {
      this.chosen = null;
      this.#edit(async (label) => {
        const clicks = joined(label, first, id);
        return clicks && merge(label, first, id, await this.#shape(clicks, []));
      });
    }
  }

  /** Most drags end where the pointer has rested: the worker has the outline there then. */
  #rest(drag, to) {
    clearTimeout(this.#resting);
    this.#resting = setTimeout(() => {
      this.#dropped(drag, to).catch(() => {}); // asked for again when the drag ends
    }, REST_MS);
  }

  #moved(drag, to) {
    this.#edit(async (label) => reshape(label, drag.instance.id, await this.#dropped(drag, to)));
  }

  async #dropped(drag, to) {
    const { shape, clicks, pulls } = dropped(drag, to);
    return shape ?? this.#shape(clicks, pulls, drag.instance.width_px);
  }

  #shape = (clicks, pulls, width = USUAL_PX) => ask("shape", { clicks, pulls, width, snaps: this.snaps });

  #edit(change) {
    const picture = this.bench.shown;
    this.#pending += 1;
    this.#tellBusy();
    this.#last = this.#last.then(async () => {
      let [label, next] = [null, null];
      do { // anew, where the service's answer took the label's place meanwhile
        label = this.bench.label(picture);
        next = await change(label);
      } while (this.bench.label(picture) !== label);
      if (picture === this.bench.shown) this.bench.edit(next);
    }).catch(this.failed).then(() => {
      this.#pending -= 1;
      this.#tellBusy();
    });
  }

  #tellBusy() {
    this.stage.frame.setAttribute("aria-busy", String(this.#opening || this.#pending > 0));
  }

  #note() {
    this.bench.note(this.bench.shown, { clicks: this.clicks });
    this.changed();
  }

  #traceOn() {
    if (!this.snaps) return void (this.trace = null);
    traceLive([...this.clicks, this.pointer], (line) => {
      if (!this.clicks.length) return;
      this.trace = line;
      this.changed();
    });
  }

  /** Outlines what is clicked so far: who looks sees whether it needs one more click, and who ends it has not to wait. */
  #lookAhead() {
    this.ahead = null;
    const { clicks } = this;
    const twice = clicks.length > 1 && away(clicks.at(-1), clicks.at(-2)) < 1; // of a double click
    if (this.tool !== "add" || !this.snaps || clicks.length < 2 || twice) return;
    this.#shape(clicks, []).then((shape) => {
      if (clicks !== this.clicks) return;
      this.ahead = shape;
      this.changed();
    }, () => {}); // asked for again, and its problem shown, when the line ends
  }

  #reach = () => NEAR_PX / this.stage.view.scale;

  /** The nearest point of a cable within reach: `{ instance, index }`. */
  #nearest(at) {
    let best = null;
    for (const instance of this.bench.label().instances) {
      shapeOf(instance).line.forEach((xy, index) => {
        const distance = away(xy, at);
        const most = best?.distance ?? Math.max(this.#reach(), instance.width_px);
        if (distance < most) best = { instance, index, distance };
      });
    }
    return best;
  }

  /** What is under a point: a crossing before a branch-point, a cable, an area. */
  #under(at) {
    const label = this.bench.label();
    const crossing = label.crossings.find(({ xy }) => away(xy, at) < 1.5 * this.#reach());
    if (crossing && this.tool !== "delete") return { crossing: crossing.id };
    const branch = (label.branch_points ?? []).findIndex((xy) => away(xy, at) < this.#reach());
    if (branch >= 0) return { branch_points: branch };
    const near = this.#nearest(at);
    if (near) return { instance: near.instance.id };
    for (const list of [MARKS.connector, MARKS.ignore]) {
      const index = (label[list] ?? []).findIndex((polygon) => inside(polygon, at));
      if (index >= 0) return { [list]: index };
    }
    return null;
  }
}

const away = ([a, b], [c, d]) => Math.hypot(a - c, b - d);
const rounded = (points) => points.map((point) => point.map((value) => Math.round(value * 100) / 100));

function without(label, what) {
  if (what.instance) return remove(label, what.instance);
  const [list] = Object.keys(what);
  return list === "crossing" ? label : unmark(label, list, what[list]);
}

/** By the parity of the sides that a ray to the right crosses. */
function inside(polygon, [x, y]) {
  return polygon.filter(([ax, ay], i) => {
    const [bx, by] = polygon[(i + 1) % polygon.length];
    return ay > y !== by > y && x < ax + ((y - ay) * (bx - ax)) / (by - ay);
  }).length % 2 === 1;
}
