// Draws a label under correction over its picture: masks, lines with a gap where they pass under, areas, points, and
// what is being drawn.

import { color } from "./colors.js";
import { dragged } from "./label_drag.js";
import { orderKnown, visiblePieces } from "./strands.js";

const SMALLEST_GAP = 7; // screen pixels, half of it

/** What an edit seldom changes: the probability and the `masks` of what nobody edited, as the worker has drawn them. `state`:
 *  `{ width, height, mask, masks, opacity, probability, hidden }`; `view` as the stage has it. */
export function drawGround(context, { width, height, mask, masks, opacity, probability, hidden }, { scale }) {
  if (mask && width && probability) spread(context, mask, width * scale, height * scale, 0.7);
  if (!masks || hidden) return;
  context.imageSmoothingEnabled = false;
  spread(context, masks.bitmap, masks.width * scale, masks.height * scale, opacity);
  context.imageSmoothingEnabled = true;
}

function spread(context, bitmap, width, height, opacity) {
  context.globalAlpha = opacity;
  context.drawImage(bitmap, 0, 0, width, height);
  context.globalAlpha = 1;
}

/** The rest. `state`: `{ label, hovered, chosen, drag, pointer, clicks, trace, ahead, tool, opacity, shows }`. */
export function drawBench(context, state, view) {
  const { label } = state;
  if (!label) return;
  if (!state.shows.hidden) {
    drawEdited(context, state, view);
    for (const instance of label.instances) drawInstance(context, instance, state, view);
    for (const crossing of label.crossings) drawCrossing(context, crossing, state, view);
  }
  drawAreas(context, state, view);
  drawUnfinished(context, state, view);
}

const place = ([x, y], { scale }) => [(x + 0.5) * scale, (y + 0.5) * scale];

/** What was edited is filled between its edges. */
function drawEdited(context, { label, opacity, drag, pointer, chosen, hovered }, view) {
  for (const item of label.instances) {
    const shape = drag?.instance?.id === item.id && pointer ? dragged(drag, pointer) : item.shape;
    if (!shape) continue;
    const marked = [chosen?.instance, hovered?.instance].includes(item.id);
    context.globalAlpha = Math.min(1, marked ? opacity + 0.2 : opacity);
    context.fillStyle = color(item.id);
    context.fill(outlineOf(shape, view));
  }
  context.globalAlpha = 1;
}

function outlineOf({ line, normals, low, high }, view) {
  const edge = (sides) => line.map(([x, y], i) => [x + sides[i] * normals[i][0], y + sides[i] * normals[i][1]]);
  return pathOf([...edge(low), ...edge(high).reverse()], view, true);
}

function pathOf(points, view, closed = false) {
  const path = new Path2D();
  points.forEach((point, i) => path[i ? "lineTo" : "moveTo"](...place(point, view)));
  if (closed) path.closePath();
  return path;
}

function drawInstance(context, instance, { label, chosen, hovered, drag, pointer }, view) {
  const moving = drag?.instance?.id === instance.id && pointer ? dragged(drag, pointer) : null;
  const width = chosen?.instance === instance.id ? 4 : hovered?.instance === instance.id ? 3.5 : 2;
  if (moving) return cased(context, pathOf(moving.line, view), color(instance.id), width);
  if (instance.centerline_xy.length < 2) return;
  for (const piece of visiblePieces(instance, label, SMALLEST_GAP / view.scale)) {
    cased(context, pathOf(piece, view), color(instance.id), width);
  }
}

/** A ring; dashed while nobody has told which cable is on top. The upper one's color fills it where the pointer is. */
function drawCrossing(context, crossing, { hovered, chosen }, view) {
  const marked = [hovered?.crossing, chosen?.crossing].includes(crossing.id);
  const path = new Path2D();
  path.arc(...place(crossing.xy, view), marked ? 12 : 9, 0, 2 * Math.PI);
  context.setLineDash(orderKnown(crossing) ? [] : [4, 4]);
  if (marked) {
    context.globalAlpha = 0.5;
    context.fillStyle = color(crossing.over.instance);
    context.fill(path);
    context.globalAlpha = 1;
  }
  cased(context, path, orderKnown(crossing) ? "#fff" : "#ffd500", 2);
  context.setLineDash([]);
}

const AREAS = [["ignore", "#aeb6c4", "ignored"], ["connectors", "#39d0ff", "connector"]];

function drawAreas(context, { label, chosen, hovered }, view) {
  for (const [list, tone] of AREAS) {
    (label[list] ?? []).forEach((polygon, index) => {
      const marked = [chosen, hovered].some((one) => one?.[list] === index);
      const path = pathOf(polygon, view, true);
      context.globalAlpha = list === "ignore" ? 0.55 : 0.25;
      context.fillStyle = tone;
      context.fill(path);
      context.globalAlpha = 1;
      cased(context, path, tone, marked ? 4 : 2);
    });
  }
  (label.branch_points ?? []).forEach((at, index) => {
    const [x, y] = place(at, view);
    const half = [chosen, hovered].some((one) => one?.branch_points === index) ? 8 : 6;
    const path = new Path2D();
    path.rect(x - half, y - half, 2 * half, 2 * half);
    cased(context, path, "#ffd23f", 3);
  });
}

function drawUnfinished(context, { clicks, trace, ahead, pointer, tool, opacity }, view) {
  if (!clicks.length) return;
  if (ahead) {
    context.globalAlpha = opacity;
    context.fillStyle = "#fff";
    context.fill(outlineOf(ahead, view));
    context.globalAlpha = 1;
  }
  const area = tool === "ignore" || tool === "connector";
  const points = pointer ? [...clicks, pointer] : clicks;
  const line = !area && trace && clicks.length ? trace : points;
  if (line.length > 1) cased(context, pathOf(tool === "connector" ? box(points) : line, view, area), "#fff", 2);
  for (const at of clicks) {
    const path = new Path2D();
    path.arc(...place(at, view), 4, 0, 2 * Math.PI);
    cased(context, path, "#fff", 2);
  }
}

/** The rectangle between the first point and the last. */
export function box(points) {
  const [[x0, y0], [x1, y1]] = [points[0], points.at(-1)];
  return [[x0, y0], [x1, y0], [x1, y1], [x0, y1]];
}

function cased(context, path, tone, width) {
  context.strokeStyle = "#000a";
  context.lineWidth = width + 2;
  context.stroke(path);
  context.strokeStyle = tone;
  context.lineWidth = width;
  context.stroke(path);
}
