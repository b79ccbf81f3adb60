// Both edges of a cable along its line: of all pairs of smooth lines the one that divides cable from surroundings best.
// A million states are looked at while somebody waits, so these loops allocate nothing, and scores are whole numbers of
// small parts: the higher of two is found without a branch, which nobody could predict here.

const OFF_LINE = 10; // samples that the middle may lie off the line
const PARTS = 1024; // of a score's unit; the longest and widest cable stays below 2^31 of them

/** Both edges of every cut, in pixels from the line: the best path through all of them. A state of a cut is a middle `a`
 *  and a half width `b`; `even` is the half width expected, or null; `pins` are kept. */
export function divided(strip, evidence, even, half, pins, o) {
  const { n, r, fine } = strip;
  const least = Math.max(2, Math.floor((0.4 * Math.min(...half)) / fine));
  const widest = Math.max(least, Math.min(r - OFF_LINE - 2, Math.ceil((1.9 * Math.max(...half)) / fine)));
  const space = { columns: 2 * OFF_LINE + 1, rows: widest - least + 1, least, swell: parts(o.swell), bend: parts(o.bend) };
  const states = space.columns * space.rows;
  const scores = new Int32Array((n + 1) * states); // of every cut; the first row is what there is before any
  const widened = new Int32Array(states);
  const shown = { low: new Int32Array(strip.m), high: new Int32Array(strip.m), odd: new Int32Array(space.rows) };
  for (let i = 0; i < n; i += 1) {
    const came = scores.subarray((i + 1) * states, (i + 2) * states);
    show(shown, strip, evidence, i, least, even ? even[i] / fine : null, o);
    reach(scores.subarray(i * states, (i + 1) * states), widened, space);
    arrive(came, widened, shown, space, r);
    for (const pin of pins) if (pin.i === i) hold(came, pin, strip, space, o);
  }
  return walked(scores, strip, space);
}

const parts = (score) => Math.round(PARTS * score);

/** What the `i`-th cut shows for a `low` edge at every sample, for a `high` one, and what every half width costs that is
 *  `odd`, off the `usual` one, if there is one. What lies between two edges is a difference of sums. */
function show({ low, high, odd }, { m, fine }, { gain, edge, trust }, i, least, usual, o) {
  const sure = PARTS * trust[i];
  let sum = 0;
  for (let k = 0, at = i * m; k < m; k += 1, at += 1) {
    const half = 0.5 * fine * gain[at]; // a sample on the edge is half cable
    const step = o.edge * edge[at];
    low[k] = Math.round(sure * (step - half - sum));
    sum += fine * gain[at];
    high[k] = Math.round(sure * (step - half + sum));
  }
  for (let b = 0; b < odd.length; b += 1) odd[b] = usual === null ? 0 : parts(o.prior * Math.abs(b + least - usual));
}

const higher = (a, b) => (a - ((a - b) & ((a - b) >> 31))) | 0;

/** For every state the best score of those with its middle whose half width is at most a sample off. */
function reach(score, widened, { columns, rows, swell }) {
  for (let a = 0, k = 0; a < columns; a += 1) {
    for (let b = 0; b < rows; b += 1, k += 1) {
      const narrower = score[b ? k - 1 : k];
      const wider = score[b < rows - 1 ? k + 1 : k];
      widened[k] = higher(score[k], (higher(narrower, wider) - swell) | 0);
    }
  }
}

/** The same over the middles, and what the cut shows for the state itself. */
function arrive(came, widened, { low, high, odd }, { columns, rows, least, bend }, r) {
  for (let a = 0, k = 0; a < columns; a += 1) {
    const middle = r + a - OFF_LINE;
    for (let b = 0; b < rows; b += 1, k += 1) {
      const left = widened[a ? k - rows : k];
      const right = widened[a < columns - 1 ? k + rows : k];
      const best = higher(widened[k], (higher(left, right) - bend) | 0);
      came[k] = (best + low[middle - least - b] + high[middle + least + b] - odd[b]) | 0;
    }
  }
}

/** Takes from every state what it misses a pin by. */
function hold(came, pin, { fine }, { columns, rows, least }, { firm }) {
  for (let a = 0, at = 0; a < columns; a += 1) {
    for (let b = least; b < least + rows; b += 1, at += 1) {
      const middle = a - OFF_LINE;
      came[at] -= parts((firm * missed(pin, (middle - b) * fine, (middle + b) * fine)) / fine);
    }
  }
}

/** How far an edge, or the whole cable, is from where a pin says. */
export function missed({ side, t }, low, high) {
  if (!side) return Math.max(0, low - t, t - high);
  return Math.abs(t - (side < 0 ? low : high));
}

/** The edges of the path that ends in the best state, back from the last cut. */
function walked(scores, { n, fine }, space) {
  const { columns, rows, least } = space;
  const states = columns * rows;
  const [low, high] = [new Array(n), new Array(n)];
  let at = 0;
  for (let k = 1; k < states; k += 1) if (scores[n * states + k] > scores[n * states + at]) at = k;
  for (let i = n - 1; i >= 0; i -= 1) {
    const [middle, wide] = [Math.floor(at / rows) - OFF_LINE, (at % rows) + least];
    low[i] = (middle - wide) * fine;
    high[i] = (middle + wide) * fine;
    at = cameFrom(scores.subarray(i * states, (i + 1) * states), at, space);
  }
  return { low, high };
}

/** The state of the cut before from which a state was reached best; without a change where that is as good. */
function cameFrom(score, at, { columns, rows, swell, bend }) {
  const [column, row] = [Math.floor(at / rows), at % rows];
  let [best, from] = [-Infinity, at];
  for (const a of [0, -1, 1]) {
    if (column + a < 0 || column + a >= columns) continue;
    for (const b of [0, -1, 1]) {
      if (row + b < 0 || row + b >= rows) continue;
      const value = score[at + a * rows + b] - (b ? swell : 0) - (a ? bend : 0);
      if (value > best) [best, from] = [value, at + a * rows + b];
    }
  }
  return from;
}
