// The pictures of the label bench: each with its label, every step of it, and whether somebody confirmed it. All of it
// is in the browser's database before the page shows it as done.

import { ask } from "./bench_calls.js";
import { forget, keep, kept, steps } from "./bench_store.js";
import { certaintyOf } from "./film.js";

const KEPT_FIELDS = [
  "key", "order", "name", "sha256", "file", "mask", "folder", "disk", "etag", "width", "height", "at", "confirmed", "certainty",
  "clicks", "seen", "synced",
];

export class Bench {
  pictures = [];
  shown = null;
  unkept = 0; // changes on their way into the database

  /** `changed()` is called after every change, `edited(picture)` after one of a label, `keeping()` when something is on its
   *  way into the database and when all is kept, `failed(error)` when the browser keeps nothing more. */
  constructor(changed, edited, keeping, failed) {
    Object.assign(this, { changed, edited, keeping, failed });
  }

  /** What was kept when the page was left. */
  async restore() {
    this.pictures = (await kept()).map((record) => ({ ...record, steps: null }));
    this.#sort();
    this.changed();
  }

  /** One picture more, or the one with the same bytes that is here already. */
  add(fields, label = null) {
    const key = `${fields.disk ? `/${fields.disk.name}` : (fields.folder ?? "")}:${fields.sha256}`;
    const known = this.pictures.find((picture) => picture.key === key);
    if (known) return known;
    const order = 1 + Math.max(0, ...this.pictures.map((picture) => picture.order));
    const picture = { order, at: 0, confirmed: false, certainty: 0, clicks: [], seen: false, ...fields, key, steps: null };
    this.pictures.push(picture);
    if (label) this.begin(picture, label, fields.confirmed ?? false);
    else this.#keep(picture);
    this.changed();
    return picture;
  }

  /** The first label of a picture: what the service found, or what a folder holds. What a person began stays. */
  begin(picture, label, confirmed = false) {
    if (picture.at > 0) return false;
    const known = { ...label, name: picture.name, sha256: picture.sha256 };
    const { width, height } = label;
    Object.assign(picture, { width, height, confirmed, certainty: certaintyOf(label), seen: true, steps: [known] });
    this.#keep(picture, known);
    this.#sort();
    this.changed();
    return true;
  }

  /** A label without cables, to draw in before the service has answered. */
  blank(picture, { width, height }) {
    const label = { format: "dlo-label/1", width, height, instances: [], crossings: [], origin: "service" };
    Object.assign(picture, { width, height, steps: [{ ...label, name: picture.name, sha256: picture.sha256 }] });
    this.#keep(picture, picture.steps[0]);
  }

  /** Somebody else's label in the place of this one, as one more step. */
  take(picture, label) {
    const { at } = picture;
    picture.steps = [...picture.steps.slice(0, at + 1), label];
    Object.assign(picture, { at: at + 1, confirmed: label.origin === "corrected", synced: true });
    this.#keep(picture, label);
    this.changed();
  }

  label(picture = this.shown) {
    return picture?.steps?.[picture.at] ?? null;
  }

  /** Reads the steps of a picture that was kept; those that came meanwhile (the service's answer, an edit) are newer. */
  async load(picture) {
    const read = picture.steps ?? (await steps(picture.key));
    picture.steps ??= read;
    picture.at = Math.max(0, Math.min(picture.at, picture.steps.length - 1));
  }

  edit(label) {
    const picture = this.shown;
    if (!label || label === this.label()) return;
    picture.at += 1;
    picture.steps = [...picture.steps.slice(0, picture.at), label];
    Object.assign(picture, { confirmed: false, clicks: [], synced: false });
    this.#keep(picture, label);
    this.edited(picture);
    this.changed();
  }

  /** One step back, or forth. */
  go(by) {
    const picture = this.shown;
    if (!picture?.steps?.[picture.at + by]) return;
    Object.assign(picture, { at: picture.at + by, confirmed: false, synced: false });
    this.#keep(picture);
    this.edited(picture);
    this.changed();
  }

  confirm(picture, confirmed) {
    Object.assign(picture, { confirmed, synced: false });
    this.#keep(picture);
    this.edited(picture);
    this.changed();
  }

  /** Notes something about a picture, such as unfinished clicks. */
  note(picture, fields) {
    Object.assign(picture, fields);
    this.#keep(picture);
  }

  async remove(pictures) {
    this.pictures = this.pictures.filter((picture) => !pictures.includes(picture));
    if (pictures.includes(this.shown)) this.shown = null;
    await forget(pictures.map(({ key }) => key));
    this.changed();
  }

  /** Labels as they leave the bench, with a mask for every cable. */
  async finished(pictures = this.pictures) {
    const out = [];
    for (const picture of pictures.filter(({ seen, at, confirmed }) => seen || at > 0 || confirmed)) {
      await this.load(picture);
      const label = this.label(picture);
      if (label) out.push(await ask("finish", { label, confirmed: picture.confirmed }));
    }
    return out;
  }

  #sort() {
    this.pictures.sort((a, b) => a.certainty - b.certainty || a.order - b.order);
  }

  #keep(picture, label = null) {
    const record = Object.fromEntries(KEPT_FIELDS.filter((name) => picture[name] !== undefined).map((name) => [name, picture[name]]));
    this.unkept += 1;
    this.keeping();
    keep(record, label).catch(this.failed).then(() => {
      this.unkept -= 1;
      if (!this.unkept) this.keeping();
    });
  }
}

/** new, changed (but nobody confirmed it) or confirmed. */
export const stateOf = ({ confirmed, at }) => (confirmed ? "confirmed" : at > 0 ? "changed" : "new");
