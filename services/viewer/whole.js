// What moves a cable as a whole, kept among its pulls as `{ by: [x, y], wider }` in the order they were made: the outline
// is found in the picture, then shifted `by` so many pixels, and each of its edges put out by `wider`. Where the picture
// shows no other edge but the label is to lie beside it, no pull of one place would do.

const LEAST_PX = 1; // of a width that is made narrower

/** `by` and `wider` of all such moves together, and the other pulls as they were before those made until then. */
export function found(pulls) {
  const whole = { by: [0, 0], wider: 0, pulls: [] };
  for (const one of pulls) {
    if (one.by) Object.assign(whole, { by: plus(whole.by, one.by), wider: whole.wider + one.wider });
    else whole.pulls.push({ ...one, at: minus(one.at, whole.by), wider: whole.wider });
  }
  return whole;
}

/** A shape that is moved and made wider; its clicks and pulls stay. */
export function carried(shape, { by, wider }) {
  const more = shape.low.map((low, i) => Math.max(wider, Math.min(0, (LEAST_PX - (shape.high[i] - low)) / 2)));
  return {
    ...shape,
    line: shape.line.map((point) => plus(point, by)),
    low: shape.low.map((t, i) => t - more[i]),
    high: shape.high.map((t, i) => t + more[i]),
    width: Math.max(LEAST_PX, shape.width + 2 * wider),
  };
}

export const plus = ([x, y], [dx, dy]) => [x + dx, y + dy];

export const minus = ([x, y], [dx, dy]) => [x - dx, y - dy];
