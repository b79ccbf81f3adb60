// Centerlines cut where another strand passes over them. Lengths in picture pixels.

/** A score of one half says that nothing tells which strand is on top. */
export const orderKnown = (crossing) => crossing.score > 0.5;

/** The pieces of an instance's centerline that lie on top; `least` is the smallest half gap. */
export function visiblePieces(instance, result, least) {
  const line = measured(instance.closed ? ring(instance.centerline_xy) : instance.centerline_xy);
  const length = measured(instance.centerline_xy).at.at(-1);
  const gaps = result.crossings
    .filter((crossing) => crossing.under.instance === instance.id)
    .map((crossing) => {
      const over = result.instances.find((other) => other.id === crossing.over.instance);
      const half = Math.max(least, 0.8 * (over?.width_px ?? 0));
      return [crossing.under.u * length - half, crossing.under.u * length + half];
    });
  return complement(gaps, line.at.at(-1)).map(([start, end]) => slice(line, start, end));
}

/** The point at share `u` of a polyline's length. */
export function pointAt(points, u) {
  const line = measured(points);
  return locate(line, u * line.at.at(-1));
}

/** The share of an instance's length that is farthest from its ends and crossings: a good place for a label. */
export function quietShare(instance, crossings) {
  const strands = crossings.flatMap(({ over, under }) => [over, under]);
  const own = strands.filter((strand) => strand.instance === instance.id).map(({ u }) => u);
  const stops = [0, ...own.sort((a, b) => a - b), 1];
  const spans = stops.slice(1).map((stop, i) => [stops[i], stop]);
  const [start, end] = spans.reduce((best, span) => (span[1] - span[0] > best[1] - best[0] ? span : best));
  return (start + end) / 2;
}

/** What is left of `[0, length]` without the gaps. */
export function complement(gaps, length) {
  const left = [];
  let start = 0;
  for (const [from, to] of [...gaps].sort((a, b) => a[0] - b[0])) {
    if (from > start) left.push([start, from]);
    start = Math.max(start, to);
  }
  if (start < length) left.push([start, length]);
  return left;
}

function measured(points) {
  const at = [0];
  for (let i = 1; i < points.length; i += 1) {
    at.push(at[i - 1] + Math.hypot(points[i][0] - points[i - 1][0], points[i][1] - points[i - 1][1]));
  }
  return { points, at };
}

function ring(points) {
  return [...points, points[0]];
}

function slice(line, start, end) {
  const inside = line.points.filter((_, i) => line.at[i] > start && line.at[i] < end);
  return [locate(line, start), ...inside, locate(line, end)];
}

function locate({ points, at }, length) {
  const next = at.findIndex((reached) => reached >= length);
  if (next <= 0) return next === 0 ? points[0] : points.at(-1);
  const share = (length - at[next - 1]) / (at[next] - at[next - 1]);
  const [[x0, y0], [x1, y1]] = [points[next - 1], points[next]];
  return [x0 + share * (x1 - x0), y0 + share * (y1 - y0)];
}
