// Keeps the service's label folder up to date with the bench: a little after each edit, at once when it is confirmed.

import { ask } from "./bench_calls.js";
import { labelOf, saveLabel } from "./bench_service.js";

const PAUSE_MS = 800;

export class Sync {
  #timers = new Map();
  #last = Promise.resolve();

  /** `conflict(picture)` answers "theirs" or "mine" when somebody else saved the label meanwhile; `changed()` when the
   *  state of saving is another; `failed(error, picture)`. */
  constructor(bench, { conflict, changed, failed }) {
    Object.assign(this, { bench, conflict, changed, failed, state: "" });
  }

  /** Saves a picture's label soon; pictures that are not of the service's folders are the browser's alone. */
  soon(picture) {
    if (!picture.folder) return;
    clearTimeout(this.#timers.get(picture));
    this.#timers.set(picture, setTimeout(() => this.now(picture), picture.confirmed ? 0 : PAUSE_MS));
    this.#tell("saving");
  }

  /** What was not saved when the page was left. */
  rest() {
    for (const picture of this.bench.pictures) if (picture.folder && picture.synced === false) this.soon(picture);
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
    try {
      const etag = await saveLabel(picture.folder, picture.name, label, picture.etag);
      const synced = picture.at === at && picture.confirmed === confirmed;
      this.bench.note(picture, { etag, synced });
      this.#tell(synced ? "saved" : "saving");
    } catch (error) {
      if (error.problem?.status !== 412) throw error;
      await this.#settle(picture);
    }
  }

  async #settle(picture) {
    const theirs = await labelOf(picture.folder, picture.name);
    const choice = await this.conflict(picture, theirs.label);
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
