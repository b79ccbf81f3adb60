// The service over HTTP. Every refusal becomes a ProblemError with the body of the problem+json.

import { events } from "./events.js";
import { t } from "./i18n.js";

const KEY = "dlo-api-key";
const FIRST_WAIT_S = 1; // most jobs have ended by then; of the others the id is known, and they can be cancelled
const NEXT_WAIT_S = 20;
const FINAL = new Set(["succeeded", "failed", "cancelled"]);

export class ProblemError extends Error {
  constructor(problem) {
    super(problem.detail);
    this.problem = problem;
  }
}

export class Api {
  key = sessionStorage.getItem(KEY) ?? localStorage.getItem(KEY) ?? "";

  keepsKey = () => localStorage.getItem(KEY) !== null;

  setKey(key, keep) {
    this.key = key;
    sessionStorage.setItem(KEY, key);
    if (keep) localStorage.setItem(KEY, key);
    else localStorage.removeItem(KEY);
  }

  /** Submits one picture or several, or other parts by their names, such as `{ mask }` and `{ image, depth }`, and follows
      the job to its end; `onChange(job)` sees every state on the way. An aborted `signal` ends the waiting, not the job,
      unless that is still on its way to the service: then nobody else could end it. */
  async run(request, files, onChange, signal) {
    const body = new FormData();
    body.append("request", JSON.stringify(request));
    const parts = files instanceof Blob || Array.isArray(files) ? { image: files } : files;
    for (const [name, given] of Object.entries(parts)) for (const file of [given ?? []].flat()) body.append(name, file);
    const job = await this.json(`v1/jobs?wait=${FIRST_WAIT_S}`, { method: "POST", body });
    if (signal?.aborted && !FINAL.has(job.state)) this.cancel(job.id).catch(() => {});
    signal?.throwIfAborted();
    return this.ended(job, onChange, signal);
  }

  /** The job once it has ended: live by its events, or by asking where a proxy holds those back. */
  async ended(job, onChange, signal) {
    try {
      if (!FINAL.has(job.state)) {
        onChange(job);
        for await (const { state, progress } of events(await this.fetch(`v1/jobs/${job.id}/events`, { signal }))) {
          onChange({ ...job, state, progress });
        }
      }
    } catch (error) {
      if (signal?.aborted) throw error;
    }
    while (!FINAL.has(job.state)) job = await this.json(`v1/jobs/${job.id}?wait=${NEXT_WAIT_S}`, { signal });
    if (job.problem) throw new ProblemError(job.problem);
    return job;
  }

  /** A picture, upright: from the browser, or for what only the service can decode (TIFF, 16 bits) from there; null if
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
    return this.stored(id);
  }

  /** A picture that the service has, as it shows it. */
  stored = async (id) => createImageBitmap(await (await this.fetch(`v1/images/${id}/preview`)).blob());

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
    const headers = { ...options.headers, ...(this.key ? { Authorization: `Bearer ${this.key}` } : {}) };
    const response = await fetch(path, { ...options, headers });
    if (!response.ok) throw new ProblemError(await problemOf(response));
    return response;
  }
}

/** The one of this page. */
export const api = new Api();

async function problemOf(response) {
  const title = `${response.status} ${response.statusText}`;
  try {
    return { title, errors: [], status: response.status, ...(await response.json()) };
  } catch {
    return { title, status: response.status, detail: t("The answer was not from this service."), errors: [] };
  }
}
