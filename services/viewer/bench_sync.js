// Keeps a label folder up to date with the bench: a little after each edit, at once when it is confirmed.

import { ask } from "./bench_calls.js";
import * as disk from "./bench_disk.js";
import * as service from "./bench_service.js";

const PAUSE_MS = 800;

/** Where a picture's label is saved: `at` a folder of this machine or of the service, `kind` how; null for one that is
 *  the browser's alone. */
export function placeOf({ disk: root, folder }) {
  if (root) return { kind: disk, at: root };
  return folder ? { kind: service, at: folder } : null;
}

export class Sync {
  #timers = new Map();
  #last = Promise.resolve();

  /** `conflict(picture)` answers "theirs" or "mine" when somebody else saved the label meanwhile; `changed()` when the
   *  state of saving is another; `failed(error, picture)`. */
  constructor(bench, { conflict, changed, failed }) {
    Object.assign(this, { bench, conflict, changed, failed, state: "" });
  }

  /** Saves a picture's label soon, where it has a place. */
  soon(picture) {
    if (!placeOf(picture)) return;
    clearTimeout(this.#timers.get(picture));
    this.#timers.set(picture, setTimeout(() => this.now(picture), picture.confirmed ? 0 : PAUSE_MS));
    this.#tell("saving");
  }

  /** What was not saved when the page was left. */
  rest() {
    for (const picture of this.bench.pictures) if (placeOf(picture) && picture.synced === false) this.soon(picture);
  }

  now(picture) {
    this.#last = this.#last.then(() => this.#save(picture)).catch((error) => {
      this.#tell("failed");
      this.failed(error, picture);
    });
    return this.#last;
  }

  async #save(picture) {
    await this.bench.load(picture);
    const { at, confirmed } = picture;
    const label = await ask("finish", { label: this.bench.label(picture), confirmed });
    const { kind, at: folder } = placeOf(picture);
    try {
      const etag = await kind.saveLabel(folder, picture.name, label, picture.etag);
      const synced = picture.at === at && picture.confirmed === confirmed;
      this.bench.note(picture, { etag, synced });
      this.#tell(synced ? "saved" : "saving");
    } catch (error) {
      if (error.problem?.status !== 412) throw error;
      await this.#settle(picture);
    }
  }

  async #settle(picture) {
    const { kind, at } = placeOf(picture);
    const theirs = await kind.labelOf(at, picture.name, picture.sha256);
    const choice = theirs.label ? await this.conflict(picture, theirs.label) : "mine"; // theirs was removed
    this.bench.note(picture, { etag: theirs.etag });
    if (choice === "mine") return this.#save(picture);
    this.bench.take(picture, theirs.label);
    return this.#tell("saved");
  }

  #tell(state) {
    this.state = state;
    this.changed();
  }
}
