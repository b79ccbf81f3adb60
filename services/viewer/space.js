// Curves, their uncertainty and cameras in space, drawn in parallel projection on a 2D canvas. World z is up.

import { t } from "./i18n.js";

const FRUSTUM = 0.12; // length of a camera's frustum, as a share of the scene's size
const NEAREST_ZOOM = 0.2;
const FARTHEST_ZOOM = 40;
const UPPER = [[0, 1, 2], [1, 3, 4], [2, 4, 5]]; // where a 3 × 3 entry stands in xx xy xz yy yz zz

export class Space {
  #turn = { yaw: -0.6, pitch: 0.6, zoom: 1 };
  #scene = { curves: [], cameras: [] };
  #box = { middle: [0, 0, 0], size: 1 };
  #named = []; // where names of cameras are written already

  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.shown = new Set(["uncertainty", "cameras", "next", "others"]);
    this.enlarged = 10;
    this.highlighted = null;
    this.#listen();
    this.draw();
  }

  /** `curves`: contracts' Curve3D with `color`; `cameras`: {T_world_camera, intrinsics, kind: used | dropped | next}. */
  show(curves, cameras) {
    this.#scene = { curves, cameras };
    this.#box = boxOf([...curves.flatMap((c) => c.points_m), ...cameras.map(centerOf)]);
    this.draw();
  }

  look(yaw, pitch) {
    Object.assign(this.#turn, { yaw, pitch });
    this.draw();
  }

  /** Pixel of a point in the world, in CSS pixels of the canvas. */
  place(point) {
    const [right, up] = this.#axes();
    const scale = this.#scale();
    const from = point.map((value, i) => value - this.#box.middle[i]);
    return [this.canvas.clientWidth / 2 + scale * dot(right, from), this.canvas.clientHeight / 2 - scale * dot(up, from)];
  }

  draw() {
    const { canvas, context } = this;
    const density = devicePixelRatio;
    canvas.width = Math.max(1, canvas.clientWidth * density);
    canvas.height = Math.max(1, canvas.clientHeight * density);
    context.setTransform(density, 0, 0, density, 0, 0);
    this.#named = [];
    if (!this.#scene.curves.length) return this.#say(t("Choose pictures and their cameras, or name a finished job."));
    this.#drawAxes();
    for (const camera of this.#scene.cameras) {
      if (this.shown.has(camera.kind === "next" ? "next" : "cameras")) this.#drawCamera(camera);
    }
    this.#scene.curves.forEach((curve, i) => {
      if (i && !this.shown.has("others")) return;
      if (this.shown.has("uncertainty")) this.#drawUncertainty(curve);
      this.#drawLine(curve.points_m, curve.color, Math.max(2, 2 * (curve.radius_m ?? 0) * this.#scale()));
    });
    this.#writeNames();
  }

  #axes() {
    const { yaw, pitch } = this.#turn;
    const [cy, sy, cp, sp] = [Math.cos(yaw), Math.sin(yaw), Math.cos(pitch), Math.sin(pitch)];
    return [[cy, sy, 0], [-sy * sp, cy * sp, cp]];
  }

  #scale() {
    return (0.95 * this.#turn.zoom * Math.min(this.canvas.clientWidth, this.canvas.clientHeight)) / this.#box.size;
  }

  #drawLine(points, color, width, dash = []) {
    const { context } = this;
    context.beginPath();
    points.forEach((point, i) => context[i ? "lineTo" : "moveTo"](...this.place(point)));
    Object.assign(context, { strokeStyle: color, lineWidth: width, lineJoin: "round", lineCap: "round" });
    context.setLineDash(dash);
    context.stroke();
    context.setLineDash([]);
  }

  #drawCamera(camera) {
    const { T_world_camera: pose, intrinsics, kind } = camera;
    const reach = FRUSTUM * this.#box.size;
    const [fx, fy] = [intrinsics.fx ?? intrinsics.K[0], intrinsics.fy ?? intrinsics.K[4]];
    const corner = (u, v) => inWorld(pose, [(u * intrinsics.width * reach) / fx, (v * intrinsics.height * reach) / fy, reach]);
    const corners = [corner(-0.5, -0.5), corner(0.5, -0.5), corner(0.5, 0.5), corner(-0.5, 0.5)];
    const color = getComputedStyle(this.canvas).getPropertyValue({ used: "--accent", dropped: "--bad", next: "--good" }[kind]);
    const width = camera === this.highlighted ? 3 : 1.2;
    const dash = kind === "used" ? [] : [5, 4];
    for (const c of corners) this.#drawLine([centerOf(camera), c], color, width, dash);
    this.#drawLine([...corners, corners[0]], color, width, dash);
    const [x, y] = this.place(centerOf(camera));
    const covered = this.#named.some(([a, b]) => Math.abs(a - x) < 60 && Math.abs(b - y) < 14);
    if (!camera.name || (covered && camera !== this.highlighted)) return;
    this.#named.push([x, y, camera.name]);
  }

  /** Over all that is drawn, and legible there. */
  #writeNames() {
    const { color, backgroundColor } = getComputedStyle(this.canvas);
    Object.assign(this.context, { fillStyle: color, strokeStyle: backgroundColor, lineWidth: 4, lineJoin: "round", font: "12px system-ui, sans-serif" });
    for (const [x, y, name] of this.#named) {
      this.context.strokeText(name, x + 6, y - 6);
      this.context.fillText(name, x + 6, y - 6);
    }
  }

  #say(text) {
    const { canvas, context } = this;
    Object.assign(context, { fillStyle: getComputedStyle(canvas).color, font: "15px system-ui, sans-serif", textAlign: "center" });
    context.fillText(text, canvas.clientWidth / 2, canvas.clientHeight / 2, canvas.clientWidth - 20);
    context.textAlign = "start";
  }

  /** The two-sigma ellipsoid of every point, as an ellipse of the projected covariance. */
  #drawUncertainty(curve) {
    const { context } = this;
    const [right, up] = this.#axes();
    const reach = 2 * this.enlarged * this.#scale();
    context.fillStyle = "#f59e0b33";
    curve.points_m.forEach((point, i) => {
      const c = curve.covariance_m2?.[i];
      if (!c) return;
      const times = (a, b) => a.reduce((sum, x, r) => sum + x * b.reduce((s, y, k) => s + y * c[UPPER[r][k]], 0), 0);
      const [xx, xy, yy] = [times(right, right), -times(right, up), times(up, up)];
      const [mean, half] = [(xx + yy) / 2, Math.hypot((xx - yy) / 2, xy)];
      const radii = [mean + half, mean - half].map((v) => Math.max(1, reach * Math.sqrt(Math.max(v, 0))));
      context.beginPath();
      context.ellipse(...this.place(point), ...radii, Math.atan2(2 * xy, xx - yy) / 2, 0, 2 * Math.PI);
      context.fill();
    });
  }

  #drawAxes() {
    const length = 10 ** Math.floor(Math.log10(this.#box.size / 3));
    const origin = this.#box.low;
    const ink = getComputedStyle(this.canvas).color;
    ["x", "y", "z"].forEach((name, i) => {
      const tip = origin.map((value, k) => value + (k === i ? length : 0));
      this.#drawLine([origin, tip], ink, 2);
      const [x, y] = this.place(tip);
      Object.assign(this.context, { fillStyle: ink, font: "12px system-ui, sans-serif" });
      this.context.fillText(i ? name : `${name}, ${length} m`, x + 4, y + 4);
    });
  }

  #listen() {
    const { canvas } = this;
    canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
    canvas.addEventListener("pointermove", (event) => {
      if (event.buttons) this.#turnBy(event.movementX * 0.01, event.movementY * 0.01);
    });
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.#zoomBy(Math.exp(-event.deltaY * 0.001));
    }, { passive: false });
    canvas.addEventListener("keydown", (event) => {
      const turns = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] }[event.key];
      const zoom = { "+": 1.2, "-": 1 / 1.2 }[event.key];
      if (turns) this.#turnBy(...turns);
      if (zoom) this.#zoomBy(zoom);
      if (turns || zoom) event.preventDefault();
    });
    addEventListener("resize", () => this.draw());
    new ResizeObserver(() => this.draw()).observe(canvas);
  }

  #turnBy(yaw, pitch) {
    this.look(this.#turn.yaw - yaw, Math.min(Math.max(this.#turn.pitch + pitch, -Math.PI / 2), Math.PI / 2));
  }

  #zoomBy(factor) {
    this.#turn.zoom = Math.min(Math.max(this.#turn.zoom * factor, NEAREST_ZOOM), FARTHEST_ZOOM);
    this.draw();
  }
}

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const centerOf = ({ T_world_camera: pose }) => pose.slice(0, 3).map((row) => row[3]);
const inWorld = (pose, local) => pose.slice(0, 3).map((row) => dot(row, local) + row[3]);

function boxOf(points) {
  if (!points.length) return { low: [0, 0, 0], middle: [0, 0, 0], size: 1 };
  const along = [0, 1, 2].map((i) => points.map((point) => point[i]));
  const [low, high] = [along.map((values) => Math.min(...values)), along.map((values) => Math.max(...values))];
  return { low, middle: low.map((value, i) => (value + high[i]) / 2), size: Math.max(Math.hypot(...high.map((v, i) => v - low[i])), 1e-3) };
}
