// What the label bench must not lose, in the browser's own database: every picture, every step of its label.

const NAME = "dlo-label-bench";
const [PICTURES, STEPS] = ["pictures", "steps"];

let opening = null;

function database() {
  opening ??= new Promise((resolve, reject) => {
    const request = indexedDB.open(NAME, 1);
    request.onupgradeneeded = () => {
      request.result.createObjectStore(PICTURES, { keyPath: "key" });
      request.result.createObjectStore(STEPS);
    };
    request.onsuccess = () => resolve(request.result);
    request.onerror = () => reject(request.error);
  });
  return opening;
}

/** Runs `work(pictures, steps)` in one transaction; resolves when it is there: `strict`, also after a loss of power. */
async function transact(mode, work, durability = "relaxed") {
  const open = (await database()).transaction([PICTURES, STEPS], mode, { durability });
  const asked = work(open.objectStore(PICTURES), open.objectStore(STEPS));
  if (mode === "readwrite") open.commit(); // now, and not when the page's thread is idle: it may be about to be left
  return new Promise((resolve, reject) => {
    open.oncomplete = () => resolve(asked?.result);
    open.onabort = open.onerror = () => reject(open.error);
  });
}

const stepKey = (key, at) => [key, at];
const stepsOf = (key) => IDBKeyRange.bound([key, 0], [key, Infinity]);

/** All that was kept, in the order in which it was opened. */
export const kept = async () => (await transact("readonly", (pictures) => pictures.getAll())).sort((a, b) => a.order - b.order);

/** The labels of a picture, from the first to the newest. */
export const steps = (key) => transact("readonly", (_, all) => all.getAll(stepsOf(key)));

/** A picture's record, and with `label` its step `record.at`; later steps, which were undone, are dropped. */
export const keep = (record, label = null) => transact("readwrite", (pictures, all) => {
  pictures.put(record);
  if (!label) return;
  all.delete(IDBKeyRange.bound([record.key, record.at], [record.key, Infinity]));
  all.put(label, stepKey(record.key, record.at));
}, label ? "strict" : "relaxed");

export const forget = (keys) => transact("readwrite", (pictures, all) => {
  for (const key of keys) {
    pictures.delete(key);
    all.delete(stepsOf(key));
  }
});
