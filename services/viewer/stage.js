// A picture that can be looked at: fitted, zoomed and panned by wheel, fingers, keys and buttons, and drawn fast however
// large it is. What lies over it is drawn by the page, in screen pixels.

import { button, element } from "./dom.js";
import { t } from "./i18n.js";
import { levelsOf, levelFor } from "./levels.js";

const MARGIN = 0.98; // of the frame, that a fitted picture fills at most
const LARGEST_FIT = 4; // screen pixels a picture pixel, when a small picture is fitted
const [NEAREST, FARTHEST] = [32, 0.5]; // screen pixels a picture pixel; of the fitted scale
const STEP = 1.25;
const CRISP = 3; // from this scale on pixels are shown as squares

export class Stage {
  #levels = [];
  #size = { width: 0, height: 0 };
  #view = { scale: 1, left: 0, top: 0 };
  #fitted = true;
  #fingers = new Map();
  #waiting = 0;
  #followers = [];
  #still = []; // all that the picture and what is on it were drawn from
  #sheet = null; // they as they are seen, from the second time on

  /** `paint(context, view)` draws over the picture: the origin is the picture's corner, units are screen pixels, and
   *  `view.scale` of them are a picture pixel. `pans(event)` tells whether a press moves the picture or is the page's.
   *  `ground.paint(context, view)` draws between both what changes seldom, when one of the values `ground.of()` is another. */
  constructor(canvas, paint, pans = () => true, ground = { of: () => [], paint: () => {} }) {
    Object.assign(this, { canvas, paint, pans, ground, context: canvas.getContext("2d") });
    this.frame = canvas.parentElement;
    this.#listen();
    new ResizeObserver(() => this.#resized()).observe(canvas);
  }

  get size() {
    return this.#size;
  }

  get view() {
    return this.#view;
  }

  /** Shows a picture of this size, whose `bitmap` may be smaller (a preview) or missing; null shows none. */
  show(size, bitmap) {
    const same = size && size.width === this.#size.width && size.height === this.#size.height;
    this.#size = size ? { width: size.width, height: size.height } : { width: 0, height: 0 };
    if (!same || bitmap !== this.#levels[0]) this.#levels = bitmap ? levelsOf(bitmap, () => this.later()) : [];
    this.frame.classList.toggle("empty", !size);
    if (same) this.redraw();
    else this.fit();
  }

  /** Keeps another stage on the same view, for pictures side by side. */
  follow(other) {
    this.#followers.push(other);
    other.#followers.push(this);
  }

  fit() {
    this.#fitted = true;
    const { width, height } = this.#size;
    const { clientWidth: w, clientHeight: h } = this.canvas;
    const scale = Math.min(LARGEST_FIT, (MARGIN * w) / (width || 1), (MARGIN * h) / (height || 1)) || 1;
    this.#set({ scale, left: (w - width * scale) / 2, top: (h - height * scale) / 2 });
  }

  actual() {
    this.zoomBy(1 / this.#view.scale);
  }

  /** About a point of the canvas, in its CSS pixels; without one, about its middle. */
  zoomBy(factor, [x, y] = [this.canvas.clientWidth / 2, this.canvas.clientHeight / 2]) {
    const { scale, left, top } = this.#view;
    const wanted = Math.max(this.#fitScale() * FARTHEST, Math.min(NEAREST, scale * factor));
    this.#fitted = false;
    const by = wanted / scale;
    this.#set({ scale: wanted, left: x - (x - left) * by, top: y - (y - top) * by });
  }

  panBy(dx, dy) {
    this.#fitted = false;
    this.#set({ ...this.#view, left: this.#view.left + dx, top: this.#view.top + dy });
  }

  /** Brings a stretch of the picture into view, in its middle where the picture goes on: corners in picture pixels. */
  lookAt([left, top], [right, bottom]) {
    const { clientWidth: w, clientHeight: h } = this.canvas;
    const { width, height } = this.#size;
    const scale = Math.min(8, (0.6 * w) / Math.max(right - left, 1), (0.6 * h) / Math.max(bottom - top, 1));
    this.#fitted = false;
    this.#set({
      scale,
      left: covering(w / 2 - (scale * (left + right)) / 2, scale * width, w),
      top: covering(h / 2 - (scale * (top + bottom)) / 2, scale * height, h),
    });
  }

  /** The center of the top-left pixel is (0, 0): it lies half a pixel inside the picture. */
  toPicture({ clientX, clientY }) {
    const box = this.canvas.getBoundingClientRect();
    const { scale, left, top } = this.#view;
    return [(clientX - box.left - left) / scale - 0.5, (clientY - box.top - top) / scale - 0.5];
  }

  /** Once before the next frame, however often it is called. */
  later() {
    this.#waiting ||= requestAnimationFrame(() => this.redraw());
  }

  redraw() {
    cancelAnimationFrame(this.#waiting);
    this.#waiting = 0;
    const { canvas, context } = this;
    const density = devicePixelRatio;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((side) => Math.max(1, Math.round(side * density)));
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.globalAlpha = 1;
    context.clearRect(0, 0, width, height);
    const { scale, left, top } = this.#view;
    Object.assign(canvas.dataset, { scale, left, top });
    if (!this.#size.width) return;
    const view = { ...this.#view, density, width: canvas.clientWidth, height: canvas.clientHeight };
    this.#drawGround(view);
    onPicture(context, view);
    context.lineCap = context.lineJoin = "round";
    this.paint(context, view);
  }

  /** The picture and what is on it. As long as nothing of it changes it is drawn once and copied: a pointer that moves over
   *  a large picture with its masks would have them scaled at every step. */
  #drawGround(view) {
    const { canvas, context } = this;
    const still = [...Object.values(view), this.#levels, this.#levels.length, ...this.ground.of()];
    const before = this.#still;
    this.#still = still;
    if (still.length !== before.length || still.some((value, k) => value !== before[k])) {
      this.#sheet = null;
      return this.#drawnOn(context, view);
    }
    if (!this.#sheet) {
      this.#sheet = new OffscreenCanvas(canvas.width, canvas.height);
      this.#drawnOn(this.#sheet.getContext("2d"), view);
    }
    return context.drawImage(this.#sheet, 0, 0);
  }

  #drawnOn(context, view) {
    onPicture(context, view);
    this.#drawPicture(context, view.density);
    this.ground.paint(context, view);
  }

  #drawPicture(context, density) {
    const { scale, left, top } = this.#view;
    const { width, height } = this.#size;
    const level = levelFor(this.#levels, scale * density * width);
    if (!level) return;
    // Only what is in view: a browser without a graphics card would scale the whole picture.
    const [x0, y0] = [Math.max(0, -left / scale), Math.max(0, -top / scale)];
    const [x1, y1] = [
      Math.min(width, (this.canvas.clientWidth - left) / scale),
      Math.min(height, (this.canvas.clientHeight - top) / scale),
    ];
    if (x1 <= x0 || y1 <= y0) return;
    const [u, v] = [level.width / width, level.height / height];
    context.imageSmoothingEnabled = scale < CRISP;
    context.drawImage(
      level, x0 * u, y0 * v, (x1 - x0) * u, (y1 - y0) * v, x0 * scale, y0 * scale, (x1 - x0) * scale, (y1 - y0) * scale,
    );
    context.imageSmoothingEnabled = true;
  }

  #fitScale() {
    const { width, height } = this.#size;
    return Math.min(LARGEST_FIT, this.canvas.clientWidth / (width || 1), this.canvas.clientHeight / (height || 1));
  }

  #set(view, told = false) {
    this.#view = view;
    this.redraw();
    if (this.readout) this.readout.value = `${Math.round(100 * view.scale)} %`;
    if (!told) for (const other of this.#followers) other.#set(view, true);
  }

  #resized() {
    if (this.#fitted && this.#size.width) this.fit();
    else this.redraw();
  }

  #listen() {
    const { canvas } = this;
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      const box = canvas.getBoundingClientRect();
      const lines = event.deltaMode ? 16 : 1;
      this.zoomBy(Math.exp(-event.deltaY * lines * 0.0015), [event.clientX - box.left, event.clientY - box.top]);
    }, { passive: false });
    canvas.addEventListener("pointerdown", (event) => this.#pressed(event));
    canvas.addEventListener("pointermove", (event) => this.#moved(event));
    for (const name of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(name, (event) => this.#fingers.delete(event.pointerId));
    }
    canvas.addEventListener("keydown", (event) => this.#typed(event));
  }

  #pressed(event) {
    const second = event.pointerType === "touch" && this.#fingers.size === 1;
    const own = event.button === 1 || second || (event.button === 0 && this.pans(event));
    if (event.pointerType !== "touch" && !own) return;
    this.#fingers.set(event.pointerId, { x: event.clientX, y: event.clientY, own });
    if (second) for (const finger of this.#fingers.values()) finger.own = true;
    if (own) this.canvas.setPointerCapture(event.pointerId);
  }

  /** Two fingers move and zoom, one pointer moves. */
  #moved(event) {
    const finger = this.#fingers.get(event.pointerId);
    if (!finger) return;
    const before = { ...finger };
    Object.assign(finger, { x: event.clientX, y: event.clientY });
    if (!finger.own) return;
    const others = [...this.#fingers.values()].filter((other) => other !== finger);
    const share = 1 / (1 + others.length);
    this.panBy(share * (finger.x - before.x), share * (finger.y - before.y));
    if (!others.length) return;
    const [other] = others;
    const apart = (one) => Math.hypot(one.x - other.x, one.y - other.y) || 1;
    const box = this.canvas.getBoundingClientRect();
    this.zoomBy(apart(finger) / apart(before), [(finger.x + other.x) / 2 - box.left, (finger.y + other.y) / 2 - box.top]);
  }

  /** Whether two fingers, or the page's own press, move the picture now. */
  get busy() {
    return [...this.#fingers.values()].some(({ own }) => own);
  }

  #typed(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const by = { ArrowLeft: [60, 0], ArrowRight: [-60, 0], ArrowUp: [0, 60], ArrowDown: [0, -60] }[event.key];
    if (by) this.panBy(...by);
    else if (event.key === "+" || event.key === "=") this.zoomBy(STEP);
    else if (event.key === "-") this.zoomBy(1 / STEP);
    else if (event.key === "0") this.fit();
    else if (event.key === "1") this.actual();
    else return;
    event.preventDefault();
  }

  /** Buttons in the frame's corner. */
  addButtons() {
    const bar = element("div", "zoom");
    this.readout = element("output");
    this.readout.setAttribute("aria-label", t("Zoom"));
    const named = (sign, name, act) => {
      const made = button(sign, act);
      made.title = t(name);
      made.setAttribute("aria-label", t(name));
      return made;
    };
    bar.append(
      named("−", "smaller (−)", () => this.zoomBy(1 / STEP)), this.readout, named("+", "larger (+)", () => this.zoomBy(STEP)),
      named(t("Fit"), "whole picture (0)", () => this.fit()), named("1:1", "actual size (1)", () => this.actual()),
    );
    this.frame.append(bar);
  }
}

/** The origin at the picture's corner, in screen pixels. */
function onPicture(context, { density, left, top }) {
  context.setTransform(density, 0, 0, density, density * left, density * top);
}

/** Where a side of a picture begins in a room: as wanted, but without a margin; in the middle where it is shorter. */
function covering(wanted, side, room) {
  return side <= room ? (room - side) / 2 : Math.max(room - side, Math.min(0, wanted));
}
