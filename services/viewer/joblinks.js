// From a job to the page that shows it.

import { element } from "./dom.js";

const PAGES = {
  instances: "./",
  topology: "viewer/harness.html",
  plan_disentangle: "viewer/harness.html",
  reconstruct: "viewer/reconstruction.html",
};

/** A link to the page that draws this kind, or else to the job's JSON. */
export function jobLink({ id, kind }) {
  const page = PAGES[kind];
  return element("a", "mono", id.slice(0, 8), { href: page ? `${page}?job=${id}` : `v1/jobs/${id}`, title: id });
}
