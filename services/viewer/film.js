// The strip of pictures: the least certain answers first, what is still on its way before them.

import { button, element } from "./dom.js";
import { t } from "./i18n.js";

const [WIDTH, HEIGHT] = [192, 108];
const FIRST = { running: -3, waiting: -2, failed: -1 };

/** 0 to 1, the lowest score of all; 0 where nothing was found: what to look at first. */
export function certaintyOf({ instances, crossings }) {
  const scores = [...instances, ...crossings].map((item) => item.score ?? 1);
  return instances.length ? Math.min(...scores) : 0;
}

export class Film {
  #items = [];

  constructor(box, onSelect) {
    Object.assign(this, { box, onSelect, selected: null });
  }

  add(items) {
    for (const item of items) {
      const made = button("", () => this.onSelect(item));
      const view = element("canvas", "", "", { width: WIDTH, height: HEIGHT });
      made.append(view, element("span", "", item.name), element("span", "mark"));
      made.title = item.name;
      this.#items.push({ item, made, view });
      this.update(item);
    }
    this.#sort();
  }

  select(item) {
    this.selected = item;
    for (const { item: other, made } of this.#items) made.setAttribute("aria-pressed", String(other === item));
    this.#of(item)?.made.scrollIntoView({ block: "nearest", inline: "nearest" });
  }

  /** The next picture in the strip's order, or the one before. */
  step(by) {
    const order = this.#sorted();
    const next = order[order.findIndex(({ item }) => item === this.selected) + by];
    if (next) this.onSelect(next.item);
  }

  picture(item) {
    const { view } = this.#of(item);
    const { bitmap } = item;
    if (!bitmap) return;
    const scale = Math.max(WIDTH / bitmap.width, HEIGHT / bitmap.height);
    const [w, h] = [bitmap.width * scale, bitmap.height * scale];
    view.getContext("2d").drawImage(bitmap, (WIDTH - w) / 2, (HEIGHT - h) / 2, w, h);
  }

  update(item) {
    const mark = this.#of(item).made.lastElementChild;
    const { result } = item.scene;
    const percent = item.progress ? ` ${Math.round(100 * item.progress)} %` : "";
    mark.className = `mark ${item.state === "failed" ? "bad" : (result?.status.code ?? "")}`;
    mark.textContent = result ? `${t(result.status.code)} ${certaintyOf(result).toFixed(2)}` : t(item.state) + percent;
    if (item.state === "done" || item.state === "failed") this.#sort();
  }

  #of = (item) => this.#items.find((entry) => entry.item === item);

  #sorted() {
    const rank = ({ item }) => (item.scene.result ? certaintyOf(item.scene.result) : (FIRST[item.state] ?? 2));
    return [...this.#items].sort((a, b) => rank(a) - rank(b));
  }

  #sort() {
    const order = this.#sorted().map(({ made }) => made);
    const moved = order.some((made, k) => made !== this.box.children[k]); // or a click that comes now would be lost
    if (moved && order.length > 1) this.box.replaceChildren(...order);
  }
}
