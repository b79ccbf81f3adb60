// Draws a harness over its picture: sections, graph, branch-points, crossings, and one action of two arms.

import { t } from "./i18n.js";
import { color } from "./colors.js";
import { pointAt } from "./strands.js";

const CASING = "rgb(0 0 0 / 0.65)";
const GAP = 8; // screen pixels, half of the gap in a section that passes under another

/** `scene`: `{ topology, focus }`; `view`: as the stage gives it, and `shown`, the set of layers, `share`: how far the
 *  action has gone. */
export function drawHarness(context, scene, action, view) {
  if (!scene.topology) return;
  const { topology, focus } = scene;
  if (view.shown.has("sections")) drawSections(context, topology, focus, view);
  if (view.shown.has("graph")) drawGraph(context, topology, view);
  if (action && view.shown.has("action")) drawAction(context, action, topology, view);
  if (view.shown.has("points")) drawPoints(context, topology, focus, view);
}

/** The center of the top-left pixel is (0, 0): it lies half a pixel inside the canvas. */
const onScreen = ([x, y], { scale }) => [(x + 0.5) * scale, (y + 0.5) * scale];

function drawSections(context, topology, focus, view) {
  for (const section of topology.sections) {
    const chosen = focus?.section === section.id;
    context.globalAlpha = !focus?.section || chosen ? 1 : 0.25;
    const under = topology.crossings.filter((c) => c.order_score > 0.5 && c.under.section === section.id);
    const path = new Path2D();
    let pen = false;
    for (const point of section.points_xy) {
      const hidden = under.some((c) => Math.hypot(c.xy[0] - point[0], c.xy[1] - point[1]) * view.scale < GAP);
      path[pen && !hidden ? "lineTo" : "moveTo"](...onScreen(point, view));
      pen = !hidden;
    }
    cased(context, path, color(section.id), chosen ? 5 : 3);
    context.globalAlpha = 1;
  }
}

function drawGraph(context, topology, view) {
  for (const { a, b, score } of topology.edges) {
    const path = line([topology.nodes_xy[a], topology.nodes_xy[b]], view);
    context.globalAlpha = 0.2 + 0.8 * score;
    stroke(context, path, "white", 1.5);
  }
  context.globalAlpha = 1;
  topology.nodes_xy.forEach((xy, k) => {
    const [x, y] = onScreen(xy, view);
    const branch = topology.node_branch_scores[k] ?? 0;
    const crossing = topology.node_crossing_scores[k] ?? 0;
    context.fillStyle = `rgb(${Math.round(255 * branch)} ${Math.round(255 * crossing)} 120)`;
    context.beginPath();
    context.arc(x, y, 3, 0, 2 * Math.PI);
    context.fill();
  });
}

function drawPoints(context, topology, focus, view) {
  for (const { id, xy } of topology.branch_points) {
    const [x, y] = onScreen(xy, view);
    const half = focus?.branch === id ? 9 : 6;
    context.fillStyle = "#ffd23f";
    context.strokeStyle = "black";
    context.lineWidth = 2;
    context.fillRect(x - half, y - half, 2 * half, 2 * half);
    context.strokeRect(x - half, y - half, 2 * half, 2 * half);
    label(context, String(id), x + half + 8, y);
  }
  for (const { id, xy, order_score: order } of topology.crossings) {
    const path = new Path2D();
    path.arc(...onScreen(xy, view), focus?.crossing === id ? 15 : 11, 0, 2 * Math.PI);
    context.setLineDash(order > 0.5 ? [] : [4, 5]);
    cased(context, path, "white", 2);
    context.setLineDash([]);
  }
}

function drawAction(context, action, topology, view) {
  const moved = topology.sections.find(({ id }) => id === action.section);
  const share = view.share ?? 0;
  if (moved) {
    context.setLineDash([2, 6]);
    cased(context, line(moved.points_xy, view), "#ff5ad1", 3);
    context.setLineDash([]);
    if (share > 0) cased(context, line(swung(moved.points_xy, action, share), view), "#ff5ad1", 4);
  }
  cased(context, line(action.trajectory_xy, view), "#7cfc9a", 3);
  gripper(context, action.hold, t("hold"), "#ffd23f", view);
  gripper(context, action.pick, t("pick"), "#7cfc9a", view);
  gripper(context, action.place, t("place"), "#7cfc9a", view);
  if (share > 0) gripper(context, along(action, share), "", "#ffffff", view);
}

/** Where the moving gripper is when `share` of the way is done, and how it is turned. */
function along({ trajectory_xy: way, pick, place }, share) {
  const turn = place.angle_rad - pick.angle_rad;
  return { xy: pointAt(way, share), angle_rad: pick.angle_rad + share * Math.atan2(Math.sin(turn), Math.cos(turn)) };
}

/** The section while it is moved: still at the holding arm, along with the gripper at the picked point and beyond, and
 *  in between by its share of the length. */
function swung(points, action, share) {
  const nearest = ([x, y]) => {
    const away = points.map(([a, b]) => Math.hypot(a - x, b - y));
    return away.indexOf(Math.min(...away));
  };
  const [hold, pick] = [nearest(action.hold.xy), nearest(action.pick.xy)];
  const at = pointAt(action.trajectory_xy, share);
  const by = at.map((value, axis) => value - action.pick.xy[axis]);
  return points.map((point, i) => {
    const part = hold === pick ? 1 : Math.max(0, Math.min(1, (i - hold) / (pick - hold)));
    return point.map((value, axis) => value + part * by[axis]);
  });
}

/** Two fingers across the section. */
function gripper(context, { xy, angle_rad: angle, arm }, name, tint, view) {
  const [x, y] = onScreen(xy, view);
  const [along, across] = [[Math.cos(angle), Math.sin(angle)], [-Math.sin(angle), Math.cos(angle)]];
  const path = new Path2D();
  for (const side of [-11, 11]) {
    path.moveTo(x + side * across[0] - 7 * along[0], y + side * across[1] - 7 * along[1]);
    path.lineTo(x + side * across[0] + 7 * along[0], y + side * across[1] + 7 * along[1]);
  }
  cased(context, path, tint, 4);
  if (name) label(context, arm ? `${name} (${arm})` : name, x, y - 22);
}

function label(context, text, x, y) {
  context.font = "600 12px system-ui, sans-serif";
  context.textAlign = "center";
  context.textBaseline = "middle";
  const half = context.measureText(text).width / 2 + 5;
  context.fillStyle = CASING;
  context.fillRect(x - half, y - 9, 2 * half, 18);
  context.fillStyle = "white";
  context.fillText(text, x, y + 0.5);
}

function line(points, view) {
  const path = new Path2D();
  points.forEach((point, i) => path[i ? "lineTo" : "moveTo"](...onScreen(point, view)));
  return path;
}

function cased(context, path, tint, width) {
  stroke(context, path, CASING, width + 2);
  stroke(context, path, tint, width);
}

function stroke(context, path, tint, width) {
  context.lineWidth = width;
  context.strokeStyle = tint;
  context.stroke(path);
}
