// Corrected labels as files: dlo-label/1 lines, from which `dlo label-import` and `label-export` make every other
// format, and COCO at once.

import { body } from "./livewire.js";
import { labelMap } from "./masks.js";

/** The label with a mask for every instance: what was not edited keeps its own, edited strokes are drawn, and at
 *  each crossing the upper strand owns the pixels. `map` is the probability that edited instances follow, or null. */
export function finished(label, map) {
  const { width, height } = label;
  const ids = new Uint16Array(width * height);
  const untouched = label.instances.filter((i) => !i.edited && i.mask_rle);
  const { ids: given, step } = labelMap({ width, height, instances: untouched });
  if (step === 1) ids.set(given);
  for (const item of label.instances.filter((i) => i.edited || !i.mask_rle)) {
    for (const at of body(map, item.centerline_xy, item.taper ?? [item.width_px, item.width_px], width, height)) ids[at] = item.id;
  }
  for (const crossing of label.crossings) raise(ids, label, crossing, map);
  const changed = label.instances.some((i) => i.edited);
  const instances = label.instances.map(({ edited, taper, ...item }) => ({
    ...item,
    mask_rle: changed ? { size: [height, width], counts: encode(ids, item.id, width, height) } : item.mask_rle,
  }));
  return { ...label, instances, origin: changed ? "corrected" : label.origin };
}

/** One JSON line a label. */
export const jsonLines = (labels) => labels.map((label) => JSON.stringify(label)).join("\n") + "\n";

/** COCO with the fields that `dlo label-import --tool coco` reads. */
export function coco(labels) {
  const annotations = labels.flatMap((label, k) =>
    label.instances.map((item) => ({
      image_id: k + 1, category_id: 1, iscrowd: 0, segmentation: item.mask_rle, instance: item.id, score: item.score,
      centerline_xy: item.centerline_xy, width_px: item.width_px, closed: item.closed,
      ...measured(item.mask_rle),
    })),
  );
  return JSON.stringify({
    info: { description: "DLO instance labels", format: "dlo-label/1" },
    licenses: [],
    categories: [{ id: 1, name: "dlo", supercategory: "dlo" }],
    images: labels.map((l, k) => ({ id: k + 1, file_name: l.name, width: l.width, height: l.height, crossings: l.crossings })),
    annotations: annotations.map((annotation, k) => ({ id: k + 1, ...annotation })),
  });
}

/** The upper strand once more around the crossing. */
function raise(ids, label, crossing, map) {
  const [upper, lower] = [crossing.over, crossing.under].map((s) => label.instances.find((i) => i.id === s.instance));
  if (!upper || !lower || !(upper.edited || lower.edited)) return;
  const reach = 1.2 * lower.width_px + upper.width_px;
  const near = upper.centerline_xy.filter(([x, y]) => Math.hypot(x - crossing.xy[0], y - crossing.xy[1]) < reach);
  const around = near.length > 1 ? near : [crossing.xy, crossing.xy];
  for (const at of body(map, around, [upper.width_px, upper.width_px], label.width, label.height)) ids[at] = upper.id;
}

/** COCO's compressed run lengths of the pixels that have this id. */
function encode(ids, id, width, height) {
  const lengths = [];
  let [inside, run] = [false, 0];
  for (let x = 0; x < width; x += 1) {
    for (let y = 0; y < height; y += 1) {
      if ((ids[y * width + x] === id) !== inside) {
        lengths.push(run);
        [inside, run] = [!inside, 0];
      }
      run += 1;
    }
  }
  lengths.push(run);
  return lengths.map((length, k) => packed(k > 2 ? length - lengths[k - 2] : length)).join("");
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
  const { ids } = labelMap({ width, height, instances: [{ id: 1, mask_rle: rle }] });
  let [area, left, top, right, bottom] = [0, Infinity, Infinity, -1, -1];
  ids.forEach((id, at) => {
    if (!id) return;
    const [x, y] = [at % width, Math.floor(at / width)];
    area += 1;
    [left, top, right, bottom] = [Math.min(left, x), Math.min(top, y), Math.max(right, x), Math.max(bottom, y)];
  });
  return { area, bbox: area ? [left, top, right - left + 1, bottom - top + 1] : [0, 0, 0, 0] };
}
