// The worker's side of bench_calls.js: every call is answered, with its result or its problem.

/** Answers calls by `functions`, by name; a `bitmap` of a result is handed over, not copied. */
export function answer(functions) {
  addEventListener("message", ({ data: { id, call, values } }) => {
    try {
      const result = functions[call](values);
      postMessage({ id, result }, result?.bitmap ? [result.bitmap] : []);
    } catch (error) {
      postMessage({ id, error: error.message });
    }
  });
}
