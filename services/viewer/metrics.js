// Prometheus' text form, as far as an operator's page reads it.

/** `{ name, labels, value }` of every sample. */
export const metricsOf = (text) =>
  text.split("\n").filter((line) => line && !line.startsWith("#")).flatMap((line) => {
    const [, name, inside = "", value] = line.match(/^(\w+)(?:\{(.*)\})? (\S+)/) ?? [];
    const labels = Object.fromEntries([...inside.matchAll(/(\w+)="((?:[^"\\]|\\.)*)"/g)].map(([, key, text]) => [key, text]));
    return name ? [{ name, labels, value: Number(value) }] : [];
  });

/** The one value of a metric without labels, or undefined. */
export const valueOf = (metrics, wanted) => metrics.find(({ name }) => name === wanted)?.value;

/** The values of a metric by one of its labels. */
export const byLabel = (metrics, wanted, label) =>
  Object.fromEntries(metrics.filter(({ name }) => name === wanted).map(({ labels, value }) => [labels[label], value]));
