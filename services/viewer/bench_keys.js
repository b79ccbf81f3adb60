// The keys of the label bench: those of CVAT where it has them (F, D, N, J, Alt+J, Del, Tab, H, Esc, Ctrl+Z,
// Ctrl+Shift+Z, Ctrl+Y, Ctrl+S), and a letter for every other tool.

import { byId, isTyping } from "./dom.js";

const TOOLS = {
  a: "add", n: "add", e: "move", m: "move", s: "split", j: "join", x: "delete", w: "swap", i: "ignore", k: "connector",
  b: "branch", v: "pan",
};

/** Listens; `held` are the keys that are down. */
export function keysOf({ tools, bench, step, confirm, save }) {
  const held = new Set();
  const take = (tool) => document.querySelector(`[name=tool][value=${tool}]`).click();
  const plain = {
    Enter: () => tools.finish(), Escape: () => tools.drop(), Backspace: () => tools.back(), Delete: () => tools.deleteChosen(),
    f: () => step(1), d: () => step(-1), h: () => byId("hide").click(), c: () => confirm(false),
  };
  const withControl = {
    z: ({ shiftKey }) => bench.go(shiftKey ? 1 : -1), y: () => bench.go(1), s: () => save(), Enter: () => confirm(true),
  };
  const actOf = (event) => {
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key; // whether Shift or Caps Lock is on or not
    if (event.ctrlKey || event.metaKey) return withControl[key];
    if (event.altKey) return event.code === "KeyJ" ? () => take("split") : null;
    // N ends what it began, as in CVAT.
    if (key === "n" && tools.clicks.length) return () => tools.finish();
    return plain[key] ?? (TOOLS[key] && (() => take(TOOLS[key])));
  };
  addEventListener("keydown", (event) => {
    if (isTyping(event)) return;
    held.add(event.key);
    const onCanvas = event.target === byId("canvas") || event.target === document.body;
    const act = event.key === "Tab" && onCanvas && tools.chosen ? () => tools.chooseNext(event.shiftKey ? -1 : 1) : actOf(event);
    const pressesButton = event.key === "Enter" && event.target.tagName === "BUTTON";
    if (event.key === " " && onCanvas) event.preventDefault();
    if (!act || pressesButton) return;
    event.preventDefault();
    act(event);
  });
  addEventListener("keyup", (event) => held.delete(event.key));
  addEventListener("blur", () => held.clear());
  return { held };
}
