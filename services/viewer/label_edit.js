// A label under correction: plain functions from one label to the next, so that undo is keeping the old ones.
// A label is `{ name, width, height, instances, crossings, … }` as in dlo-label/1; an edited instance has `edited`.

const DEFAULT_WIDTH_PX = 6;
const SAME_PLACE_PX = 15;

/** A new instance on top of the others. */
export function add(label, line, width, taper = null) {
  const id = 1 + Math.max(0, ...label.instances.map((i) => i.id));
  return crossed({ ...label, instances: [...label.instances, drawn(id, line, width, taper)] });
}

/** The instance with another centerline (and width, when it was measured). */
export function reshape(label, id, line, width, taper = null) {
  return replaced(label, id, (old) => [drawn(id, line, width ?? old.width_px, taper)]);
}

export function remove(label, id) {
  return replaced(label, id, () => []);
}

/** Two instances from one, cut at the centerline's `index`-th point; the second gets a new id. */
export function split(label, id, index) {
  const next = 1 + Math.max(...label.instances.map((i) => i.id));
  return replaced(label, id, (old) => {
    const line = old.centerline_xy;
    if (index < 1 || index > line.length - 2) return [old];
    return [drawn(id, line.slice(0, index + 1), old.width_px), drawn(next, line.slice(index), old.width_px)];
  });
}

/** One instance from two, by their nearest ends; `bridge(from, to)` gives the line between these. */
export function join(label, first, second, bridge) {
  const [a, b] = [first, second].map((id) => label.instances.find((i) => i.id === id));
  if (!a || !b || a === b) return label;
  const ways = [
    [a.centerline_xy, b.centerline_xy],
    [a.centerline_xy, b.centerline_xy.toReversed()],
    [a.centerline_xy.toReversed(), b.centerline_xy],
    [a.centerline_xy.toReversed(), b.centerline_xy.toReversed()],
  ];
  const gap = ([p, q]) => Math.hypot(p.at(-1)[0] - q[0][0], p.at(-1)[1] - q[0][1]);
  const [head, tail] = ways.reduce((best, way) => (gap(way) < gap(best) ? way : best));
  const line = [...head, ...bridge(head.at(-1), tail[0]).slice(1, -1), ...tail];
  const kept = replaced(label, second, () => []);
  return replaced(kept, first, () => [drawn(first, line, (a.width_px + b.width_px) / 2)]);
}

/** The other strand on top. */
export function swap(label, crossingId) {
  const crossing = label.crossings.find((c) => c.id === crossingId);
  if (!crossing) return label;
  const turned = { ...crossing, over: crossing.under, under: crossing.over, score: 1 };
  const strands = [crossing.over.instance, crossing.under.instance];
  return {
    ...label,
    crossings: label.crossings.map((c) => (c === crossing ? turned : c)),
    instances: label.instances.map((i) => (strands.includes(i.id) ? { ...i, edited: true } : i)),
  };
}

/** 0 to 1, the lowest score of all; 0 where nothing was found: what to look at first. */
export function certainty(label) {
  const scores = [...label.instances, ...label.crossings].map((item) => item.score ?? 1);
  return label.instances.length ? Math.min(...scores) : 0;
}

function drawn(id, line, width, taper = null) {
  return {
    id, score: null, centerline_xy: line.map(([x, y]) => [round(x), round(y)]), width_px: round(width ?? DEFAULT_WIDTH_PX),
    closed: false, mask_rle: null, spline: null, endpoints: [], length_px: round(lengths(line).at(-1)), edited: true, taper,
  };
}

const round = (value) => Math.round(value * 100) / 100;

function replaced(label, id, change) {
  return crossed({ ...label, instances: label.instances.flatMap((i) => (i.id === id ? change(i) : [i])) });
}

/** Crossings anew for edited instances; the order of those that were there is kept. A new one has the later
 *  instance on top, and score 0.5: nobody has looked at it. */
function crossed(label) {
  const edited = new Set(label.instances.filter((i) => i.edited).map((i) => i.id));
  const present = new Set(label.instances.map((i) => i.id));
  const involved = (c, set) => set.has(c.over.instance) || set.has(c.under.instance);
  const kept = label.crossings.filter((c) => !involved(c, edited) && present.has(c.over.instance) && present.has(c.under.instance));
  const found = [];
  label.instances.forEach((a, k) => {
    for (const b of label.instances.slice(k + 1)) {
      if (edited.has(a.id) || edited.has(b.id)) found.push(...meetings(a, b));
    }
  });
  const ordered = found.map((c) => {
    const old = label.crossings.find((o) => Math.hypot(o.xy[0] - c.xy[0], o.xy[1] - c.xy[1]) < SAME_PLACE_PX);
    const upside = old && old.over.instance === c.under.instance && old.under.instance === c.over.instance;
    const same = old && old.over.instance === c.over.instance && old.under.instance === c.under.instance;
    return upside ? { ...c, over: c.under, under: c.over, score: old.score } : { ...c, score: same ? old.score : 0.5 };
  });
  return { ...label, crossings: [...kept, ...ordered].map((c, k) => ({ ...c, id: k + 1 })) };
}

function meetings(a, b) {
  const [at, bt] = [lengths(a.centerline_xy), lengths(b.centerline_xy)];
  const found = [];
  for (let i = 1; i < at.length; i += 1) {
    for (let j = 1; j < bt.length; j += 1) {
      const hit = meeting(a.centerline_xy[i - 1], a.centerline_xy[i], b.centerline_xy[j - 1], b.centerline_xy[j]);
      if (!hit) continue;
      const u = (at[i - 1] + hit.t * (at[i] - at[i - 1])) / at.at(-1);
      const v = (bt[j - 1] + hit.u * (bt[j] - bt[j - 1])) / bt.at(-1);
      found.push({ xy: hit.xy.map(round), over: { instance: b.id, u: v }, under: { instance: a.id, u } });
    }
  }
  return found;
}

function meeting([ax, ay], [bx, by], [cx, cy], [dx, dy]) {
  const area = (bx - ax) * (dy - cy) - (by - ay) * (dx - cx);
  if (!area) return null;
  const t = ((cx - ax) * (dy - cy) - (cy - ay) * (dx - cx)) / area;
  const u = ((cx - ax) * (by - ay) - (cy - ay) * (bx - ax)) / area;
  return t >= 0 && t < 1 && u >= 0 && u < 1 ? { t, u, xy: [ax + t * (bx - ax), ay + t * (by - ay)] } : null;
}

function lengths(points) {
  const at = [0];
  for (let i = 1; i < points.length; i += 1) {
    at.push(at[i - 1] + Math.hypot(points[i][0] - points[i - 1][0], points[i][1] - points[i - 1][1]));
  }
  return at;
}
