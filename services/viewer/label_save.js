// Corrected labels as files: dlo-label/1 lines, from which `dlo label-import` and `label-export` make every other
// format, and COCO at once.

import { part, shapeOf } from "./label_edit.js";
import { labelMap } from "./masks.js";
import { filled } from "./outline.js";

/** The label with a mask for every instance: what was not edited keeps its own, edited ones are filled between their
 *  edges, and at each crossing the upper strand owns the pixels. It is a correction only if somebody `confirmed` it. */
export function finished(label, confirmed) {
  const { width, height } = label;
  const changed = label.instances.some((i) => i.edited || !i.mask_rle);
  const ids = changed ? painted(label) : null;
  const columns = changed ? columnsOf(ids, width) : null;
  const instances = label.instances.map(({ edited, shape, ...item }) => {
    if (!changed) return item;
    const own = columns.get(item.id) ?? [width, -1];
    return { ...item, mask_rle: { size: [height, width], counts: encode(ids, item.id, width, height, own) } };
  });
  const origin = confirmed ? "corrected" : label.origin === "corrected" ? "service" : label.origin;
  return { ...label, instances, origin };
}

/** The id of every pixel. */
function painted(label) {
  const { width, height } = label;
  const ids = new Uint16Array(width * height);
  const untouched = label.instances.filter((i) => !i.shape && i.mask_rle);
  ids.set(labelMap({ width, height, instances: untouched }, Infinity).ids);
  for (const item of label.instances.filter((i) => i.shape || !i.mask_rle)) {
    for (const at of filled(shapeOf(item), width, height)) ids[at] = item.id;
  }
  for (const crossing of label.crossings) raise(ids, label, crossing);
  return ids;
}

/** One JSON line a label. */
export const jsonLines = (labels) => labels.map((label) => JSON.stringify(label)).join("\n") + "\n";

/** COCO with the fields that `dlo label-import --tool coco` reads. Areas to ignore are crowds of the same class, as
 *  COCO's own evaluation has them; connectors have a class of their own. */
export function coco(labels) {
  const annotations = labels.flatMap((label, k) => {
    const of = (category_id, iscrowd, more) => ({ image_id: k + 1, category_id, iscrowd, ...more });
    const outlined = (polygon) => ({ segmentation: [polygon.flatMap(([x, y]) => [x + 0.5, y + 0.5])], ...around(polygon) });
    return [
      ...label.instances.map((item) => of(1, 0, {
        segmentation: item.mask_rle, instance: item.id, score: item.score, centerline_xy: item.centerline_xy,
        width_px: item.width_px, closed: item.closed, ...measured(item.mask_rle),
      })),
      ...(label.ignore ?? []).map((polygon) => of(1, 1, outlined(polygon))),
      ...(label.connectors ?? []).map((polygon) => of(2, 0, outlined(polygon))),
    ];
  });
  return JSON.stringify({
    info: { description: "DLO instance labels", format: "dlo-label/1" },
    licenses: [],
    categories: [{ id: 1, name: "dlo", supercategory: "dlo" }, { id: 2, name: "connector", supercategory: "dlo" }],
    images: labels.map((l, k) => ({
      id: k + 1, file_name: l.name, sha256: l.sha256, confirmed: l.origin === "corrected", width: l.width, height: l.height,
      crossings: l.crossings, branch_points: l.branch_points ?? [],
    })),
    annotations: annotations.map((annotation, k) => ({ id: k + 1, ...annotation })),
  });
}

/** Area and box of a polygon. */
function around(polygon) {
  const [xs, ys] = [0, 1].map((axis) => polygon.map((point) => point[axis] + 0.5));
  const [left, top] = [Math.min(...xs), Math.min(...ys)];
  const twice = polygon.reduce((sum, _, i) => {
    const j = (i + 1) % polygon.length;
    return sum + xs[i] * ys[j] - xs[j] * ys[i];
  }, 0);
  return { area: Math.abs(twice) / 2, bbox: [left, top, Math.max(...xs) - left, Math.max(...ys) - top] };
}

/** The upper strand once more around the crossing. */
function raise(ids, label, crossing) {
  const [upper, lower] = [crossing.over, crossing.under].map((s) => label.instances.find((i) => i.id === s.instance));
  if (!upper || !lower || !(upper.edited || lower.edited)) return;
  const reach = 1.2 * lower.width_px + upper.width_px;
  const shape = shapeOf(upper);
  const near = shape.line.map(([x, y]) => Math.hypot(x - crossing.xy[0], y - crossing.xy[1]) < reach);
  for (let from = near.indexOf(true); from >= 0; ) {
    const end = near.indexOf(false, from);
    for (const at of filled(part(shape, from, end < 0 ? near.length : end), label.width, label.height)) ids[at] = upper.id;
    from = end < 0 ? -1 : near.indexOf(true, end);
  }
}

/** COCO's compressed run lengths of the pixels that have this id, which are in the columns `from` to `to`. */
function encode(ids, id, width, height, [from, to]) {
  const lengths = [];
  let [inside, run] = [false, from * height];
  for (let x = from; x <= to; x += 1) {
    for (let y = 0; y < height; y += 1) {
      if ((ids[y * width + x] === id) !== inside) {
        lengths.push(run);
        [inside, run] = [!inside, 0];
      }
      run += 1;
    }
  }
  const rest = (width - 1 - Math.max(to, from - 1)) * height;
  if (inside && rest) lengths.push(run, rest);
  else lengths.push(run + rest);
  return lengths.map((length, k) => packed(k > 2 ? length - lengths[k - 2] : length)).join("");
}

/** First and last column of every id. */
function columnsOf(ids, width) {
  const columns = new Map();
  for (let at = 0, x = 0; at < ids.length; at += 1, x = x + 1 === width ? 0 : x + 1) {
    const id = ids[at];
    if (!id) continue;
    const known = columns.get(id);
    if (!known) columns.set(id, [x, x]);
    else if (x < known[0]) known[0] = x;
    else if (x > known[1]) known[1] = x;
  }
  return columns;
}

function packed(value) {
  let text = "";
  for (let more = true; more; ) {
    let bits = value & 0x1f;
    value >>= 5;
    more = bits & 0x10 ? value !== -1 : value !== 0;
    if (more) bits |= 0x20;
    text += String.fromCharCode(bits + 48);
  }
  return text;
}

function measured(rle) {
  const [height, width] = rle.size;
  const { ids } = labelMap({ width, height, instances: [{ id: 1, mask_rle: rle }] }, Infinity);
  let [area, left, top, right, bottom] = [0, Infinity, Infinity, -1, -1];
  ids.forEach((id, at) => {
    if (!id) return;
    const [x, y] = [at % width, Math.floor(at / width)];
    area += 1;
    [left, top, right, bottom] = [Math.min(left, x), Math.min(top, y), Math.max(right, x), Math.max(bottom, y)];
  });
  return { area, bbox: area ? [left, top, right - left + 1, bottom - top + 1] : [0, 0, 0, 0] };
}
