// English and German. The English text is the key: what has no translation yet stays English.

import { GERMAN } from "./german.js";

const LANGUAGE = "dlo-language";
const NAMED = ["placeholder", "title", "aria-label", "alt"];

export const language = () => localStorage.getItem(LANGUAGE) ?? (navigator.language?.startsWith("de") ? "de" : "en");

export function choose(wanted) {
  localStorage.setItem(LANGUAGE, wanted);
  location.reload();
}

/** The text in the language chosen; `{name}` in it is replaced by `values.name`. */
export function t(text, values = {}) {
  const found = language() === "de" ? (GERMAN[text] ?? text) : text;
  return found.replace(/\{(\w+)\}/g, (whole, name) => values[name] ?? whole);
}

/** All that the page's own HTML says, in place. */
export function translate(root = document.documentElement) {
  document.documentElement.lang = language();
  if (language() !== "de") return;
  const walker = document.createTreeWalker(root, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const { data } = walker.currentNode;
    const known = GERMAN[data.trim().replace(/\s+/g, " ")];
    if (known) walker.currentNode.data = data.replace(/\S[\s\S]*\S|\S/, () => known);
  }
  for (const name of NAMED) {
    for (const node of root.querySelectorAll(`[${name}]`)) node.setAttribute(name, t(node.getAttribute(name)));
  }
}
