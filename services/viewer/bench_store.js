// What the label bench must not lose, in the browser's own database: every picture, every step of its label. A picture's
// bytes and its probability lie apart from the record, which every click writes anew.

import { t } from "./i18n.js";

const NAME = "dlo-label-bench";
const STORES = ["pictures", "steps", "files"];
const APART = ["file", "mask"]; // fields of a picture in the third

let opening = null;
const written = new Map(); // place in the third → what lies there

function database() {
  opening ??= new Promise((resolve, reject) => {
    const request = indexedDB.open(NAME, 2);
    request.onupgradeneeded = ({ oldVersion }) => {
      if (!oldVersion) request.result.createObjectStore("pictures", { keyPath: "key" });
      if (!oldVersion) request.result.createObjectStore("steps");
      request.result.createObjectStore("files"); // version 1 had them in the records, where they stay until the next step
    };
    request.onsuccess = () => resolve(request.result);
    request.onerror = () => reject(request.error);
    request.onblocked = () => reject(new Error(t("The bench is open in another tab too: work in one of them only")));
  });
  return opening;
}

/** Runs `work(pictures, steps, files)` in one transaction; resolves to the results of the requests that it returns when
 *  all is there: `strict`, also after a loss of power. */
async function transact(mode, work, durability = "relaxed") {
  const open = (await database()).transaction(STORES, mode, { durability });
  const asked = work(...STORES.map((name) => open.objectStore(name)));
  if (mode === "readwrite") open.commit(); // now, and not when the page's thread is idle: it may be about to be left
  return new Promise((resolve, reject) => {
    open.oncomplete = () => resolve(asked?.map(({ result }) => result));
    open.onabort = open.onerror = () => reject(open.error);
  });
}

const stepKey = (key, at) => [key, at];
const allOf = (key) => IDBKeyRange.bound([key], [key, []]); // an array comes after every number and string

/** All that was kept, in the order in which it was opened. */
export async function kept() {
  const [records, places, files] = await transact("readonly", (pictures, _, apart) => [
    pictures.getAll(), apart.getAllKeys(), apart.getAll(),
  ]);
  const byKey = new Map(records.map((record) => [record.key, record]));
  places.forEach(([key, field], k) => {
    written.set(`${field} ${key}`, files[k]);
    if (byKey.has(key)) byKey.get(key)[field] = files[k];
  });
  return records.sort((a, b) => a.order - b.order);
}

/** The labels of a picture, from the first to the newest. */
export const steps = async (key) => (await transact("readonly", (_, all) => [all.getAll(allOf(key))]))[0];

/** A picture's record, and with `label` its step `record.at`; later steps, which were undone, are dropped. */
export async function keep({ file, mask, ...record }, label = null) {
  const { key, at } = record;
  const fresh = Object.entries({ file, mask }).filter(([field, value]) => value && written.get(`${field} ${key}`) !== value);
  for (const [field, value] of fresh) written.set(`${field} ${key}`, value);
  try {
    await transact("readwrite", (pictures, all, files) => {
      pictures.put(record);
      for (const [field, value] of fresh) files.put(value, [key, field]);
      if (!label) return;
      all.delete(IDBKeyRange.bound([key, at], [key, Infinity]));
      all.put(label, stepKey(key, at));
    }, label ? "strict" : "relaxed");
  } catch (error) {
    for (const [field] of fresh) written.delete(`${field} ${key}`);
    throw error;
  }
}

export async function forget(keys) {
  await transact("readwrite", (pictures, all, files) => {
    for (const key of keys) {
      pictures.delete(key);
      all.delete(allOf(key));
      files.delete(allOf(key));
      for (const field of APART) written.delete(`${field} ${key}`);
    }
  });
}
