// The label bench's workers, as functions that return promises. Of live traces only the newest is worth its time.

const [outlines, masks] = ["./bench_worker.js", "./bench_masks.js"].map(started);
const BESIDE = new Set(["finish", "masks"]); // no click waits for these: they have a worker of their own
const waiting = new Map();
let next = 1;

function started(path) {
  const worker = new Worker(new URL(path, import.meta.url), { type: "module" });
  worker.addEventListener("message", ({ data: { id, result, error } }) => {
    const { resolve, reject } = waiting.get(id);
    waiting.delete(id);
    if (error) reject(new Error(error));
    else resolve(result);
  });
  return worker;
}

export function ask(call, values) {
  return new Promise((resolve, reject) => {
    waiting.set(next, { resolve, reject });
    (BESIDE.has(call) ? masks : outlines).postMessage({ id: next, call, values });
    next += 1;
  });
}

let [tracing, wanted] = [false, null];

/** Traces `points` and hands the line to `take`, unless newer points came meanwhile. */
export async function traceLive(points, take) {
  wanted = points;
  if (tracing) return;
  tracing = true;
  while (wanted) {
    const asked = wanted;
    wanted = null;
    const line = await ask("trace", { points: asked }).catch(() => null);
    if (line && !wanted) take(line);
  }
  tracing = false;
}
