// A folder of this machine that the browser lets the page write into, laid out as `dlo label` does: `labels/`, `drafts/` of
// what somebody changed, `corrected/` of what somebody confirmed. A label is saved only over the one that was read: what
// somebody else saved meanwhile is not overwritten. Firefox and Safari let no page write into a folder.

import { api, ProblemError } from "./api.js";
import { t } from "./i18n.js";

const NEWEST_FIRST = ["drafts", "corrected", "labels"];
const LEDGER = "ledger.sqlite";
const WRITE = { mode: "readwrite" };

export const canWrite = () => "showDirectoryPicker" in globalThis;

/** What somebody chose, or null: `{ root, entries }`, the folder in it that holds the labels and all files as
 *  `{ path, blob() }`. */
export async function chosen() {
  const picked = await showDirectoryPicker({ ...WRITE, id: "dlo-labels" }).catch((error) => {
    if (error.name === "AbortError") return null; // nobody chose one
    throw error;
  });
  if (!picked) return null;
  const entries = [];
  const roots = new Map();
  for await (const { path, folder, handle } of within(picked, "")) {
    const part = path.split("/").at(-1);
    if (handle.kind === "file") entries.push({ path, blob: () => handle.getFile() });
    const marks = part === LEDGER || (handle.kind === "directory" && NEWEST_FIRST.includes(part));
    if (marks && !NEWEST_FIRST.includes(folder.name)) roots.set(path.slice(0, -part.length), folder);
  }
  if (roots.size > 1) throw new Error(t("There are several label folders in it ({names}): choose one of them and its pictures", { names: [...roots.keys()].sort().join(", ") }));
  return { root: [...roots.values()][0] ?? picked, entries };
}

async function* within(folder, path) {
  for await (const [name, handle] of folder.entries()) {
    if (name.startsWith(".")) continue;
    yield { path: path + name, folder, handle };
    if (handle.kind === "directory") yield* within(handle, `${path}${name}/`);
  }
}

/** Whether the page may still write there: after a reload somebody has to allow it once more. */
export const allowed = async (root) => (await root.queryPermission(WRITE)) === "granted";

export const allow = async (root) => (await root.requestPermission(WRITE)) === "granted";

/** `{ label, etag }` of a picture as it is there now; null and "" where there is none. Throws where it cannot be read, or
 *  is of a picture with other bytes. */
export async function labelOf(root, name, sha256) {
  await reached(root);
  const file = await newest(root, name);
  if (!file) return { label: null, etag: "" };
  const label = await file.text().then(JSON.parse).catch(() => null);
  if (!label) throw new Error(t("{name}: its label in the folder cannot be read", { name }));
  if (label.sha256 && label.sha256 !== sha256) throw new Error(t("{name}: the label in the folder is of a picture with other bytes", { name }));
  return { label, etag: await api.digest(file) };
}

/** Saves a label as a draft, or where its origin is `corrected` as a correction; gives its new tag. Throws a ProblemError
 *  with status 412 when it is another one there by now. */
export async function saveLabel(root, name, label, etag = "") {
  await reached(root);
  const file = await newest(root, name);
  if ((file ? await api.digest(file) : "") !== etag) {
    const detail = t("somebody else saved this label meanwhile");
    throw new ProblemError({ status: 412, code: "changed_meanwhile", detail });
  }
  const part = label.origin === "corrected" ? "corrected" : "drafts";
  const content = new Blob([JSON.stringify(label)]);
  const { folder, last } = await placeOf(root, part, name, true);
  const writable = await (await folder.getFileHandle(last, { create: true })).createWritable();
  await writable.write(content); // beside the file, whose place it takes when it is closed
  await writable.close();
  if (part === "corrected") await found(root, "drafts", name, (draft) => draft.folder.removeEntry(draft.last));
  return api.digest(content);
}

async function reached(root) {
  if (!(await allowed(root))) throw new Error(t("The browser asks again before the page may save in this folder: see Open"));
}

/** The file of the label that counts; null where there is none. An empty one was never written to its end. */
async function newest(root, name) {
  for (const part of NEWEST_FIRST) {
    const file = await found(root, part, name, ({ folder, last }) => folder.getFileHandle(last).then((handle) => handle.getFile()));
    if (file?.size) return file;
  }
  return null;
}

/** What `take({ folder, last })` gives of the folder and the name of a label's file; null where they are not there. */
async function found(root, part, name, take) {
  try {
    return await take(await placeOf(root, part, name, false));
  } catch (error) {
    if (error.name === "NotFoundError") return null;
    throw error;
  }
}

async function placeOf(root, part, name, create) {
  const steps = `${part}/${name}.json`.split("/");
  const last = steps.pop();
  let folder = root;
  for (const step of steps) folder = await folder.getDirectoryHandle(step, { create });
  return { folder, last };
}
