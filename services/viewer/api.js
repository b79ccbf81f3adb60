// The service over HTTP. Every refusal becomes a ProblemError with the body of the problem+json.

const FIRST_WAIT_S = 1; // then the job's id is known, and it can be cancelled
const NEXT_WAIT_S = 20;
const FINAL = new Set(["succeeded", "failed", "cancelled"]);

export class ProblemError extends Error {
  constructor(problem) {
    super(problem.detail);
    this.problem = problem;
  }
}

export class Api {
  key = "";

  /** Submits one picture or several, or a mask where `part` is "mask", and follows the job to its end; `onChange(job)`
      sees every state on the way. */
  async run(request, files, onChange, signal, part = "image") {
    const body = new FormData();
    body.append("request", JSON.stringify(request));
    for (const file of [files].flat()) body.append(part, file);
    let job = await this.json(`v1/jobs?wait=${FIRST_WAIT_S}`, { method: "POST", body, signal });
    while (!FINAL.has(job.state)) {
      onChange(job);
      job = await this.json(`v1/jobs/${job.id}?wait=${NEXT_WAIT_S}`, { signal });
    }
    if (job.problem) throw new ProblemError(job.problem);
    return job;
  }

  /** A picture, upright: from the browser, or for what only the service can decode (a TIFF) from there; null if
   *  nobody can. */
  async bitmap(file) {
    try {
      return await createImageBitmap(file, { imageOrientation: "from-image" });
    } catch {
      return this.preview(file).catch(() => null);
    }
  }

  async preview(file) {
    const { id } = await this.json("v1/images", { method: "POST", body: file });
    return createImageBitmap(await (await this.fetch(`v1/images/${id}/preview`)).blob());
  }

  /** SHA-256 of a file's bytes, in hex. A page over plain HTTP may not hash: there the service does. */
  async digest(file) {
    if (!globalThis.crypto?.subtle) return (await this.json("v1/images", { method: "POST", body: file })).sha256;
    const bytes = new Uint8Array(await crypto.subtle.digest("SHA-256", await file.arrayBuffer()));
    return Array.from(bytes, (byte) => byte.toString(16).padStart(2, "0")).join("");
  }

  cancel = (id) => this.json(`v1/jobs/${id}`, { method: "DELETE" });
  networks = () => this.json("v1/models");
  file = async (id, name) => (await this.fetch(`v1/jobs/${id}/files/${name}`)).blob();
  json = async (path, options) => (await this.fetch(path, options)).json();

  async fetch(path, options = {}) {
    const headers = this.key ? { Authorization: `Bearer ${this.key}` } : {};
    const response = await fetch(path, { ...options, headers });
    if (!response.ok) throw new ProblemError(await problemOf(response));
    return response;
  }
}

async function problemOf(response) {
  const title = `${response.status} ${response.statusText}`;
  try {
    return { title, errors: [], ...(await response.json()) };
  } catch {
    return { title, detail: "The answer was not from this service.", errors: [] };
  }
}
