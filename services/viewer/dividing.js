// Both edges of a cable along its line: of all pairs of smooth lines the one that divides cable from surroundings best.
// A million states are looked at while somebody waits, so these loops allocate nothing.

const OFF_LINE = 10; // samples that the middle may lie off the line

/** Both edges of every cut, in pixels from the line: the best path through all of them. A state of a cut is a middle `a`
 *  and a half width `b`; `even` is the half width expected, or null; `pins` are kept. */
export function divided(strip, evidence, even, half, pins, o) {
  const { n, r, fine } = strip;
  const least = Math.max(2, Math.floor((0.4 * Math.min(...half)) / fine));
  const widest = Math.max(least, Math.min(r - OFF_LINE - 2, Math.ceil((1.9 * Math.max(...half)) / fine)));
  const space = { columns: 2 * OFF_LINE + 1, rows: widest - least + 1, least };
  const states = space.columns * space.rows;
  const before = new Int8Array(n * states);
  const sums = new Float64Array(strip.m + 1);
  const buffers = { widened: new Float64Array(states), swelled: new Int8Array(states) };
  let [score, came] = [new Float64Array(states), new Float64Array(states)];
  for (let i = 0; i < n; i += 1) {
    summed(sums, evidence.gain, i * strip.m, fine);
    arrived(score, came, before.subarray(i * states, (i + 1) * states), buffers, space, o);
    weighted(came, sums, strip, evidence, i, space, even ? even[i] / fine : null, o);
    for (const pin of pins) if (pin.i === i) held(came, pin, strip, space, o);
    [score, came] = [came, score];
  }
  return walked(score, before, strip, space);
}

function summed(sums, gain, from, fine) {
  for (let k = 0; k < sums.length - 1; k += 1) sums[k + 1] = sums[k] + gain[from + k] * fine;
}

/** For every state the best `score` of the cut before from which it can be reached, into `came`, and `from` which way:
 *  three times the change of the middle, and that of the half width. The buffers are for what lies between. */
function arrived(score, came, from, { widened, swelled }, { columns, rows }, { swell, bend }) {
  const states = score.length;
  for (let a = 0, k = 0; a < columns; a += 1) {
    for (let b = 0; b < rows; b += 1, k += 1) {
      let best = score[k];
      let way = 0;
      if (b > 0 && score[k - 1] - swell > best) {
        best = score[k - 1] - swell;
        way = -1;
      }
      if (b < rows - 1 && score[k + 1] - swell > best) {
        best = score[k + 1] - swell;
        way = 1;
      }
      widened[k] = best;
      swelled[k] = way;
    }
  }
  for (let k = 0; k < states; k += 1) {
    let best = widened[k];
    let way = swelled[k];
    if (k >= rows && widened[k - rows] - bend > best) {
      best = widened[k - rows] - bend;
      way = swelled[k - rows] - 3;
    }
    if (k + rows < states && widened[k + rows] - bend > best) {
      best = widened[k + rows] - bend;
      way = swelled[k + rows] + 3;
    }
    came[k] = best;
    from[k] = way;
  }
}

/** Adds to every state what the `i`-th cut shows for it, and what a half width off the `usual` one costs, if there is
 *  one. `sums` are those of the gain up to every sample. */
function weighted(came, sums, { m, r, fine }, { gain, edge, trust }, i, { columns, rows, least }, usual, o) {
  const from = i * m;
  const sure = trust[i];
  const prior = usual === null ? 0 : o.prior;
  const expected = usual ?? 0;
  const onEdge = 0.5 * fine; // a sample on the edge is half cable
  const step = o.edge;
  for (let a = 0, at = 0; a < columns; a += 1) {
    for (let b = least; b < least + rows; b += 1, at += 1) {
      const low = r + a - OFF_LINE - b;
      const high = r + a - OFF_LINE + b;
      const body = sums[high + 1] - sums[low] - onEdge * (gain[from + low] + gain[from + high]);
      came[at] += sure * (body + step * (edge[from + low] + edge[from + high])) - prior * Math.abs(b - expected);
    }
  }
}

/** Takes from every state what it misses a pin by. */
function held(came, pin, { fine }, { columns, rows, least }, { firm }) {
  for (let a = 0, at = 0; a < columns; a += 1) {
    for (let b = least; b < least + rows; b += 1, at += 1) {
      const middle = a - OFF_LINE;
      came[at] -= (firm * missed(pin, (middle - b) * fine, (middle + b) * fine)) / fine;
    }
  }
}

/** How far an edge, or the whole cable, is from where a pin says. */
export function missed({ side, t }, low, high) {
  if (!side) return Math.max(0, low - t, t - high);
  return Math.abs(t - (side < 0 ? low : high));
}

/** The edges of the path that ends in the best state, back from the last cut. */
function walked(score, before, { n, fine }, { rows, least }) {
  const [low, high] = [new Array(n), new Array(n)];
  let at = 0;
  for (let k = 1; k < score.length; k += 1) if (score[k] > score[at]) at = k;
  for (let i = n - 1; i >= 0; i -= 1) {
    const [middle, wide] = [Math.floor(at / rows) - OFF_LINE, (at % rows) + least];
    low[i] = (middle - wide) * fine;
    high[i] = (middle + wide) * fine;
    const step = before[i * score.length + at];
    const moved = Math.round(step / 3);
    at += moved * rows + step - 3 * moved;
  }
  return { low, high };
}
