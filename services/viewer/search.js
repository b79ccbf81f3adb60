// The cheapest path between two pixels of a picture: over the foreground probability and what has the color of the
// clicks. It runs while a pointer moves, so its loops allocate nothing.

const SIDE_PX = 60; // how far a path may leave the box around its two clicks, and as far as these are apart
const SAME_TONE = 12; // gray levels from a click's color, within which it is the cable's
const TONE_SHARE = 0.8; // the probability there, at least
const OTHER_TONE = 40; // gray levels, beyond which it is something else
const OTHER_SHARE = 0.5; // of the probability, that is taken away there
const [RIGHT, DOWN] = [[1, -1, 0, 0, 1, 1, -1, -1], [0, 0, 1, -1, 1, -1, 1, -1]].map((steps) => Int8Array.from(steps));
const LENGTH = Float64Array.from(RIGHT, (dx, s) => Math.hypot(dx, DOWN[s]));

/** A map with what a search in it needs: `prices` of its pixels, 0 where none was asked for yet, the `lowest` there can
 *  be, and the `tones` of the clicks, which are a cable's. */
export function searchable(view, clicks) {
  const tones = Float64Array.from(clicks.flatMap((click) => toneAt(view, click)));
  return { ...view, prices: new Float32Array(view.width * view.height), tones, lowest: lowestPrice(view) };
}

const toneAt = ({ planes, width, height }, [x, y]) => planes.map((plane) => plane[clamp(y, height - 1) * width + clamp(x, width - 1)]);

const clamp = (v, most) => Math.max(0, Math.min(most, Math.round(v)));

/** Pixels from one click to the next, both included. */
export function cheapest(map, from, to) {
  const box = boxAround(map, from, to);
  const at = ([x, y]) => (clamp(y, map.height - 1) - box.top) * box.w + clamp(x, map.width - 1) - box.left;
  const goal = at(to);
  const before = searched(map, box, at(from), goal);
  const path = [];
  for (let i = goal; i >= 0; i = before[i]) path.push([(i % box.w) + box.left, Math.floor(i / box.w) + box.top]);
  return path.reverse();
}

function boxAround(map, from, to) {
  const side = SIDE_PX + Math.hypot(to[0] - from[0], to[1] - from[1]);
  const left = clamp(Math.min(from[0], to[0]) - side, map.width - 1);
  const top = clamp(Math.min(from[1], to[1]) - side, map.height - 1);
  const w = clamp(Math.max(from[0], to[0]) + side, map.width - 1) - left + 1;
  const h = clamp(Math.max(from[1], to[1]) + side, map.height - 1) - top + 1;
  return { left, top, w, h };
}

/** For every pixel of the box the one before it on the cheapest path from `start`, until `goal` is reached (A*: what is
 *  left costs the map's lowest price at least). */
function searched(map, { left, top, w, h }, start, goal) {
  const reached = new Float64Array(w * h).fill(Infinity);
  const before = new Int32Array(w * h).fill(-1);
  const done = new Uint8Array(w * h);
  const open = new Heap();
  const { prices, width, lowest } = map;
  const [goalX, goalY] = [goal % w, Math.floor(goal / w)];
  reached[start] = 0;
  open.push(start, 0);
  while (open.size) {
    const i = open.pop();
    if (i === goal) break;
    if (done[i]) continue;
    done[i] = 1;
    const x = i % w;
    const y = (i - x) / w;
    const here = reached[i];
    for (let s = 0; s < 8; s += 1) {
      const u = x + RIGHT[s];
      const v = y + DOWN[s];
      if (u < 0 || u >= w || v < 0 || v >= h) continue;
      const j = v * w + u;
      if (done[j]) continue;
      const place = (v + top) * width + u + left;
      if (!prices[place]) prices[place] = price(map, place);
      const next = here + LENGTH[s] * prices[place];
      if (next >= reached[j]) continue;
      reached[j] = next;
      before[j] = i;
      const across = Math.abs(u - goalX);
      const down = Math.abs(v - goalY);
      open.push(j, next + lowest * (Math.max(across, down) + (Math.SQRT2 - 1) * Math.min(across, down)));
    }
  }
  return before;
}

const price = (map, i) => priceOf(likely(map, i), map.depth[i]);
const priceOf = (p, depth) => 0.05 + 3 * (1 - p) ** 2 + 0.6 / (1 + depth);

/** What no pixel of the map costs less than, whatever its color. */
function lowestPrice({ p, depth }) {
  let [surest, deepest] = [TONE_SHARE, 0];
  for (let i = 0; i < p.length; i += 1) {
    if (p[i] > surest) surest = p[i];
    if (depth[i] > deepest) deepest = depth[i];
  }
  return priceOf(surest, deepest);
}

/** The probability, raised where the color is that of a click, for the network misses a gray cable on gray ground, and
 *  lowered where it is far from that, for there are other cables. */
export function likely({ p, planes, tones }, i) {
  const light = planes[0][i];
  const red = planes[1][i];
  const yellow = planes[2][i];
  let least = Infinity;
  for (let k = 0; k < tones.length; k += 3) {
    const brighter = 0.5 * (light - tones[k]); // light changes along a cable more than its color does
    const redder = red - tones[k + 1];
    const yellower = yellow - tones[k + 2];
    const away = brighter * brighter + redder * redder + yellower * yellower;
    if (away < least) least = away;
  }
  const other = 1 - Math.exp(-least / (2 * OTHER_TONE ** 2));
  return Math.max(p[i] * (1 - OTHER_SHARE * other), TONE_SHARE * Math.exp(-least / (2 * SAME_TONE ** 2)));
}

/** Items by rising keys; an item may be in it more than once. */
class Heap {
  size = 0;
  #items = new Int32Array(4096);
  #keys = new Float64Array(4096);

  push(item, key) {
    if (this.size === this.#items.length) this.#grow();
    const items = this.#items;
    const keys = this.#keys;
    let at = this.size;
    this.size += 1;
    while (at > 0) {
      const parent = (at - 1) >> 1;
      if (keys[parent] <= key) break;
      items[at] = items[parent];
      keys[at] = keys[parent];
      at = parent;
    }
    items[at] = item;
    keys[at] = key;
  }

  /** The item with the lowest key. */
  pop() {
    const items = this.#items;
    const keys = this.#keys;
    const first = items[0];
    this.size -= 1;
    const count = this.size;
    const item = items[count];
    const key = keys[count];
    let at = 0;
    for (let child = 1; child < count; child = 2 * at + 1) {
      if (child + 1 < count && keys[child + 1] < keys[child]) child += 1;
      if (keys[child] >= key) break;
      items[at] = items[child];
      keys[at] = keys[child];
      at = child;
    }
    items[at] = item;
    keys[at] = key;
    return first;
  }

  #grow() {
    const [items, keys] = [this.#items, this.#keys];
    this.#items = new Int32Array(2 * items.length);
    this.#keys = new Float64Array(2 * keys.length);
    this.#items.set(items);
    this.#keys.set(keys);
  }
}
