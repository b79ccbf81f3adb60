// What moves a cable as a whole, kept among its pulls as `{ by: [x, y], wider, side }` in the order they were made: the
// outline is found in the picture, then shifted `by` so many pixels, and its edges put out by `wider`, with a `side` (-1, 1)
// that one alone. Where the picture shows no other edge but the label is to lie beside it, no pull of one place would do.

const LEAST_PX = 1; // of a width that is made narrower

/** All such moves together, `by` and how far `out` the low and the high edge are put, and the other pulls as they were
 *  before those made until then. */
export function found(pulls) {
  const whole = { by: [0, 0], out: [0, 0], pulls: [] };
  for (const one of pulls) {
    if (one.by) Object.assign(whole, { by: plus(whole.by, one.by), out: plus(whole.out, outOf(one)) });
    else whole.pulls.push({ ...one, at: minus(one.at, whole.by), wider: whole.out[one.side < 0 ? 0 : 1] });
  }
  return whole;
}

/** How far one move puts out the low and the high edge. */
export const outOf = ({ wider, side = 0 }) => [side > 0 ? 0 : wider, side < 0 ? 0 : wider];

/** A shape that is moved and made wider; its clicks and pulls stay. */
export function carried(shape, { by, out }) {
  const wider = out[0] + out[1];
  const shares = shape.low.map((low, i) => (wider < 0 ? Math.min(1, Math.max(0, shape.high[i] - low - LEAST_PX) / -wider) : 1));
  return {
    ...shape,
    line: shape.line.map((point) => plus(point, by)),
    low: shape.low.map((t, i) => t - shares[i] * out[0]),
    high: shape.high.map((t, i) => t + shares[i] * out[1]),
    width: Math.max(LEAST_PX, shape.width + wider),
  };
}

export const plus = ([x, y], [dx, dy]) => [x + dx, y + dy];

export const minus = ([x, y], [dx, dy]) => [x - dx, y - dy];
