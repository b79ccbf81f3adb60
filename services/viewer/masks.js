// COCO run-length masks to one map of instance ids, for the tint and for what lies under the pointer.

const LARGEST_MAP = 4e6; // pixels; a larger picture gets a coarser map

/** `{ ids, width, height, step }`: `ids[y * width + x]` is the instance at picture pixel `(x, y) * step`, or 0. */
export function labelMap(result, largest = LARGEST_MAP) {
  const step = Math.max(1, Math.ceil(Math.sqrt((result.width * result.height) / largest)));
  const width = Math.ceil(result.width / step);
  const height = Math.ceil(result.height / step);
  const ids = new Uint16Array(width * height);
  for (const { id, mask_rle } of result.instances) {
    const rows = mask_rle.size[0];
    for (const [start, end] of foreground(runs(mask_rle.counts))) {
      for (let at = start; at < end; at += 1) {
        const x = Math.floor(at / rows);
        const y = at - x * rows;
        if (x % step === 0 && y % step === 0) ids[(y / step) * width + x / step] = id;
      }
    }
  }
  return { ids, width, height, step, present: result.instances.map(({ id }) => id) };
}

/** The instance within `reach` picture pixels of `(x, y)`, or 0. */
export function instanceAt(map, x, y, reach) {
  const radius = Math.ceil(reach / map.step);
  const column = Math.round(x / map.step);
  const row = Math.round(y / map.step);
  let [nearest, best] = [0, Infinity];
  for (let v = Math.max(0, row - radius); v <= Math.min(map.height - 1, row + radius); v += 1) {
    for (let u = Math.max(0, column - radius); u <= Math.min(map.width - 1, column + radius); u += 1) {
      const distance = Math.hypot(u - column, v - row);
      const id = map.ids[v * map.width + u];
      if (id && distance < best) [nearest, best] = [id, distance];
    }
  }
  return nearest;
}

/** A canvas with every instance in its color, or `only` that one; `rgb(id)` gives `[r, g, b]`. The last is kept. */
export function tint(map, rgb, only) {
  if (!map.tinted || map.tinted.only !== only) map.tinted = { only, canvas: tinted(map, rgb, only) };
  return map.tinted.canvas;
}

function tinted(map, rgb, only) {
  const pixels = new ImageData(map.width, map.height);
  const packed = new Uint32Array(pixels.data.buffer);
  const colors = new Uint32Array(2 ** 16); // stays 0, transparent, for the background and what is not wanted
  for (const id of map.present) if (!only || id === only) colors[id] = packedColor(rgb(id));
  for (let at = 0; at < packed.length; at += 1) packed[at] = colors[map.ids[at]];
  const canvas = new OffscreenCanvas(map.width, map.height);
  canvas.getContext("2d").putImageData(pixels, 0, 0);
  return canvas;
}

const packedColor = (channels) => new Uint32Array(new Uint8Array([...channels, 255]).buffer)[0];

/** Run lengths of COCO's compressed string: 5 bits a character, and differences to the run before the last. */
export function runs(counts) {
  const lengths = [];
  for (let at = 0; at < counts.length; ) {
    let value = 0;
    let shift = 0;
    let code;
    do {
      code = counts.charCodeAt(at++) - 48;
      value += (code & 0x1f) * 2 ** shift;
      shift += 5;
    } while (code & 0x20);
    if (code & 0x10) value -= 2 ** shift;
    if (lengths.length > 2) value += lengths[lengths.length - 2];
    lengths.push(value);
  }
  return lengths;
}

function foreground(lengths) {
  const intervals = [];
  let at = 0;
  lengths.forEach((length, index) => {
    if (index % 2) intervals.push([at, at + length]);
    at += length;
  });
  return intervals;
}
