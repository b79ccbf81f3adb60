// Draws what was found in a picture, over it. Lines and markers keep their size on the screen at any scale.

import { color, inkOn, rgb } from "./colors.js";
import { tint } from "./masks.js";
import { orderKnown, pointAt, quietShare, visiblePieces } from "./strands.js";

const CASING = "rgb(0 0 0 / 0.65)";
const WARNING = "#ffb020";
const SMALLEST_GAP = 7; // screen pixels, half of it
const LINE = 2.5;

/** `scene`: `{ result, map }`. `view`: as the stage gives it, and `shown`, the set of layers, `focus`: `{ instance }`,
 *  `{ crossing }` or null, `opacity` of the masks, `culprits`: what is below the limit of the result's status. */
export function draw(context, scene, view) {
  if (!scene.result) return;
  if (view.shown.has("mask")) drawMask(context, scene.map, view);
  if (view.shown.has("unsure")) for (const culprit of view.culprits) drawCulprit(context, culprit, scene.result, view);
  for (const [layer, drawInstance] of INSTANCE_LAYERS) {
    if (!view.shown.has(layer)) continue;
    for (const instance of scene.result.instances) {
      context.globalAlpha = inFocus(instance, scene.result, view.focus) ? 1 : 0.25;
      drawInstance(context, instance, scene.result, view);
    }
  }
  context.globalAlpha = 1;
  if (!view.shown.has("crossings")) return;
  for (const crossing of scene.result.crossings) drawCrossing(context, crossing, view);
}

/** What makes a result unsure, the least certain first: `{ instance }` or `{ crossing }`. */
export function culpritsOf({ status, instances, crossings }) {
  const below = (items, name) => items.filter(({ score }) => score < status.limit).map(({ id, score }) => ({ [name]: id, score }));
  if (status.code !== "unsure") return [];
  return [...below(instances, "instance"), ...below(crossings, "crossing")].sort((a, b) => a.score - b.score);
}

const INSTANCE_LAYERS = [
  ["centerlines", drawCenterline],
  ["endpoints", drawEndpoints],
  ["numbers", drawNumber],
];

function inFocus(instance, result, focus) {
  if (!focus) return true;
  if (focus.instance) return focus.instance === instance.id;
  const crossing = result.crossings.find(({ id }) => id === focus.crossing);
  return [crossing?.over.instance, crossing?.under.instance].includes(instance.id);
}

/** The center of the top-left pixel is (0, 0): it lies half a pixel inside the canvas. */
const onScreen = ([x, y], { scale }) => [(x + 0.5) * scale, (y + 0.5) * scale];

function drawMask(context, map, { scale, focus, opacity = 0.4 }) {
  context.globalAlpha = opacity;
  context.imageSmoothingEnabled = false;
  const size = map.step * scale;
  context.drawImage(tint(map, rgb, focus?.instance), 0, 0, map.width * size, map.height * size);
  context.imageSmoothingEnabled = true;
  context.globalAlpha = 1;
}

/** A halo of warning color along the cable, or around the crossing. */
function drawCulprit(context, { instance, crossing }, result, view) {
  const path = new Path2D();
  const line = result.instances.find(({ id }) => id === instance)?.centerline_xy ?? [];
  line.forEach((point, i) => path[i ? "lineTo" : "moveTo"](...onScreen(point, view)));
  const at = result.crossings.find(({ id }) => id === crossing);
  if (at) path.arc(...onScreen(at.xy, view), 17, 0, 2 * Math.PI);
  context.lineCap = "butt";
  context.setLineDash([7, 5]);
  cased(context, path, WARNING, 7);
  context.setLineDash([]);
  context.lineCap = "round";
}

function drawCenterline(context, instance, result, view) {
  const width = view.focus?.instance === instance.id ? LINE + 1.5 : LINE;
  const path = new Path2D();
  for (const piece of visiblePieces(instance, result, SMALLEST_GAP / view.scale)) {
    piece.forEach((point, i) => path[i ? "lineTo" : "moveTo"](...onScreen(point, view)));
  }
  cased(context, path, color(instance.id), width);
}

function drawEndpoints(context, instance, _, view) {
  for (const { xy, kind } of instance.endpoints) {
    const path = MARKERS[kind](...onScreen(xy, view));
    context.lineWidth = 2;
    context.fillStyle = kind === "hidden" ? CASING : color(instance.id);
    context.strokeStyle = kind === "hidden" ? color(instance.id) : "white";
    context.fill(path);
    context.stroke(path);
  }
}

const MARKERS = {
  free: (x, y) => circle(x, y, 5.5),
  border: (x, y) => polygon([x - 5, y - 5], [x + 5, y - 5], [x + 5, y + 5], [x - 5, y + 5]),
  hidden: (x, y) => polygon([x, y - 6], [x + 6, y], [x, y + 6], [x - 6, y]),
};

function drawNumber(context, instance, result, view) {
  const share = quietShare(instance, result.crossings);
  const place = onScreen(pointAt(instance.centerline_xy, share), view);
  const text = String(instance.id);
  context.font = "600 12px system-ui, sans-serif";
  context.textAlign = "center";
  context.textBaseline = "middle";
  const half = context.measureText(text).width / 2 + 5;
  const x = inside(place[0], half, result.width * view.scale);
  const y = inside(place[1], 9, result.height * view.scale);
  const plate = new Path2D();
  plate.roundRect(x - half, y - 9, 2 * half, 18, 9);
  context.fillStyle = color(instance.id);
  context.fill(plate);
  context.lineWidth = 1;
  context.strokeStyle = "#111";
  context.stroke(plate);
  context.fillStyle = inkOn(instance.id);
  context.fillText(text, x, y + 0.5);
}

const inside = (value, margin, size) => Math.max(margin, Math.min(size - margin, value));

function drawCrossing(context, crossing, view) {
  const chosen = view.focus?.crossing === crossing.id;
  const path = circle(...onScreen(crossing.xy, view), chosen ? 15 : 11);
  context.setLineDash(orderKnown(crossing) ? [] : [4, 5]);
  cased(context, path, "white", chosen ? 3 : 1.5);
  context.setLineDash([]);
}

function cased(context, path, stroke, width) {
  context.lineWidth = width + 2;
  context.strokeStyle = CASING;
  context.stroke(path);
  context.lineWidth = width;
  context.strokeStyle = stroke;
  context.stroke(path);
}

function circle(x, y, radius) {
  const path = new Path2D();
  path.arc(x, y, radius, 0, 2 * Math.PI);
  return path;
}

function polygon(first, ...others) {
  const path = new Path2D();
  path.moveTo(...first);
  for (const point of others) path.lineTo(...point);
  path.closePath();
  return path;
}
