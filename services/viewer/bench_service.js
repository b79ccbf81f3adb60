// Label folders of the service. A label is saved with the ETag that it was read with: what somebody else saved meanwhile
// is not overwritten.

import { api } from "./api.js";

const path = (folder, part, name) => `v1/label-folders/${encodeURIComponent(folder)}/${part}?name=${encodeURIComponent(name)}`;

/** Names of the folders; none where the service has no label folders, or not for this key. */
export const folders = async () => (await api.json("v1/label-folders").catch(() => ({ folders: [] }))).folders;

export const picturesOf = async (folder) => (await api.json(`v1/label-folders/${encodeURIComponent(folder)}`)).pictures;

export async function pictureOf(folder, name) {
  const blob = await (await api.fetch(path(folder, "picture", name))).blob();
  return new File([blob], name.split("/").at(-1), { type: blob.type });
}

/** `{ label, etag }` as it is there now. */
export async function labelOf(folder, name) {
  const response = await api.fetch(path(folder, "label", name), { cache: "no-store" });
  return { label: await response.json(), etag: response.headers.get("ETag") };
}

/** Saves a label as a draft, or where its origin is `corrected` as a correction; gives its new ETag. Throws a
 *  ProblemError with status 412 when it is another one there by now. */
export async function saveLabel(folder, name, label, etag) {
  const response = await api.fetch(path(folder, "label", name), {
    method: "PUT",
    headers: { "If-Match": etag, "Content-Type": "application/json" },
    body: JSON.stringify(label),
  });
  return response.headers.get("ETag");
}

/** An archive of labels in another tool's format, which the SDK writes. */
export const exported = async (format, lines) =>
  (await api.fetch(`v1/label-exports?format=${format}`, { method: "POST", body: lines })).blob();

/** A YOLO folder with its pictures as an archive: labels from the service, and each of `pictures` (`{ name, file,
 *  folder }`) where that puts it. */
export async function yolo(lines, pictures) {
  const { archiveOf, entriesOf } = await import("./zip.js");
  const entries = await entriesOf(await exported("yolo", lines));
  const listed = entries.find(({ path }) => path.endsWith("/images.json"));
  const files = entries.filter((entry) => entry !== listed).map(async ({ path, blob }) => ({ path, blob: await blob() }));
  const root = listed.path.replace("images.json", "");
  const images = Object.entries(JSON.parse(await (await listed.blob()).text())).map(async ([name, place]) => {
    const { file, folder } = pictures.find((picture) => picture.name === name);
    return { path: root + place, blob: file ?? (await pictureOf(folder, name)) };
  });
  return archiveOf(await Promise.all([...files, ...images]));
}

/** The pictures that the service keeps because it was unsure of them, the least sure first; none where it keeps none. */
export const unsurePictures = () => api.json("v1/unsure").catch(() => []);

export async function unsurePicture(id) {
  const blob = await (await api.fetch(`v1/unsure/${id}`)).blob();
  return new File([blob], `unsure-${id.slice(0, 8)}`, { type: blob.type });
}
