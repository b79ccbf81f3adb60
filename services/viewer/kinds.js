// The kinds of color in a strip, by k-means over brightness and two color differences.

const ROUNDS = 8;
const MORE_ROUNDS = 2; // from middles that were found nearby
const SAMPLES = 3000;
const CELLS = 128; // of two levels each, along brightness and both color differences
const SHADOWS = [0.85, 0.7, 0.55]; // of the light, that is left in a shadow
const cells = new Uint8Array(CELLS ** 3); // a kind and one; 0 where nobody has looked. Kept: it takes two megabytes

/** The kind of color of every sample, by k-means; `shadows`: shares of kinds on the ground, to those where a part of the
 *  ground lies in shadow, which darkens a color and keeps its tone; and the `centers` of the kinds, from which those of
 *  nearly the same strip are found sooner. */
export function sorted({ colors }, { kinds: count, shade }, before = null) {
  const few = fewOf(colors);
  const centers = clustered(few, count, before);
  const darker = Array.from({ length: count }, (_, k) => SHADOWS.map((part) => {
    const [light, red, yellow] = centers.subarray(3 * k, 3 * k + 3);
    return alike(centers, part * light, part * red, part * yellow);
  }));
  const shadows = (ground) => {
    const made = ground.map((share) => (1 - shade) * share);
    darker.forEach((kinds, k) => kinds.forEach((kind) => (made[kind] += (shade * ground[k]) / SHADOWS.length)));
    return made;
  };
  return { kinds: named(colors, centers), shadows, centers };
}

/** Few samples' colors, three numbers each. */
function fewOf([light, red, yellow]) {
  const stride = Math.max(1, Math.floor(light.length / SAMPLES));
  const few = new Float32Array(3 * Math.floor(light.length / stride));
  for (let at = 0, i = 0; at < few.length; at += 3, i += stride) {
    few[at] = light[i];
    few[at + 1] = red[i];
    few[at + 2] = yellow[i];
  }
  return few;
}

/** The middles of the kinds, three numbers each, from those `before`. */
function clustered(few, count, before) {
  const total = few.length / 3;
  const centers = before?.slice() ?? spread(few, count);
  const [sums, counts] = [new Float64Array(3 * count), new Float64Array(count)];
  const kinds = new Uint8Array(total);
  for (let round = before ? ROUNDS - MORE_ROUNDS : 0; round < ROUNDS; round += 1) {
    sums.fill(0);
    counts.fill(0);
    for (let i = 0, at = 0; i < total; i += 1, at += 3) {
      const k = alike(centers, few[at], few[at + 1], few[at + 2], kinds[i]);
      kinds[i] = k;
      counts[k] += 1;
      sums[3 * k] += few[at];
      sums[3 * k + 1] += few[at + 1];
      sums[3 * k + 2] += few[at + 2];
    }
    for (let at = 0; at < 3 * count; at += 1) {
      const own = counts[Math.floor(at / 3)];
      if (own) centers[at] = sums[at] / own;
    }
  }
  return centers;
}

/** Samples evenly spread over the brightness. */
function spread(few, count) {
  const total = few.length / 3;
  const bright = Array.from({ length: total }, (_, i) => 3 * i).sort((a, b) => few[a] - few[b]);
  const centers = new Float64Array(3 * count);
  for (let k = 0; k < count; k += 1) {
    const at = bright[Math.floor(((k + 0.5) * total) / count)];
    centers.set(few.subarray(at, at + 3), 3 * k);
  }
  return centers;
}

/** The kind whose middle is nearest; a good `guess` spares most of the others. */
function alike(centers, light, red, yellow, guess = 0) {
  let best = guess;
  let least = apart(centers, 3 * guess, light, red, yellow);
  for (let k = 0, at = 0; at < centers.length; k += 1, at += 3) {
    const x = light - centers[at];
    if (x * x >= least) continue;
    const d = apart(centers, at, light, red, yellow);
    if (d < least) {
      best = k;
      least = d;
    }
  }
  return best;
}

/** Light changes along a cable more than its color does. */
function apart(centers, at, light, red, yellow) {
  const x = light - centers[at];
  const y = red - centers[at + 1];
  const z = yellow - centers[at + 2];
  return x * x + 2 * (y * y + z * z);
}

/** The kind of every sample, looked for once in each cell of two levels a side: most samples have a neighbor's color. */
function named([light, red, yellow], centers) {
  cells.fill(0);
  const kinds = new Uint8Array(light.length);
  for (let i = 0; i < kinds.length; i += 1) {
    const a = cellOf(light[i]);
    const b = cellOf(red[i] + 128);
    const c = cellOf(yellow[i] + 128);
    const at = (a * CELLS + b) * CELLS + c;
    if (!cells[at]) cells[at] = 1 + alike(centers, 2 * a + 1, 2 * b - 127, 2 * c - 127);
    kinds[i] = cells[at] - 1;
  }
  return kinds;
}

const cellOf = (value) => Math.max(0, Math.min(CELLS - 1, value >> 1));
