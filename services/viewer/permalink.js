// The address of an answer: `?job=ID`, and `picture=SHA256` where the service still has the picture.

import { api } from "./api.js";

const shown = new Map(); // id → picture that this page showed, for back and forward

/** Puts a picture's job into the address and the history, as soon as its id is known: a reload then finds it. */
export async function remember(picture, id) {
  const known = shown.has(id);
  shown.set(id, picture);
  if (known || new URLSearchParams(location.search).get("job") === id) return;
  const sha256 = picture.file?.size ? await api.digest(picture.file).catch(() => "") : "";
  address(`?job=${id}${sha256 ? `&picture=${sha256}` : ""}`);
}

/** This page with another query: its path is named, for the pages' base is another folder. */
export const address = (query) => history.pushState(null, "", location.pathname + query);

/** Opens what the address names, now and when somebody goes back: `open(job, bitmap)` what is not known here, `again`
 *  what is. */
export function follow(kind, open, failed, again) {
  const go = async () => {
    const asked = new URLSearchParams(location.search);
    const id = asked.get("job");
    if (!id) return;
    if (shown.has(id)) return again(shown.get(id));
    try {
      const job = await api.ended(await api.json(`v1/jobs/${encodeURIComponent(id)}`), () => {});
      if (![kind].flat().includes(job.result?.kind)) throw new Error(`${id}: ${job.kind}, ${job.state}`);
      const picture = asked.get("picture");
      open(job, picture ? await api.stored(picture).catch(() => null) : null);
    } catch (error) {
      failed(error);
    }
  };
  addEventListener("popstate", go);
  go();
}
