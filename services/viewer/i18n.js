// English and German. The English text is the key: what has no translation yet stays English. German is loaded for who
// reads it; where it cannot be loaded, the page is English.

const LANGUAGE = "dlo-language";
const NAMED = ["placeholder", "title", "aria-label", "alt"];

/** As first.js found it. */
export const language = () => document.documentElement.lang;

const GERMAN = language() === "de" ? await import("./german.js").then((loaded) => loaded.GERMAN, () => ({})) : {};

export function choose(wanted) {
  localStorage.setItem(LANGUAGE, wanted);
  location.reload();
}

/** The text in the language chosen; `{name}` in it is replaced by `values.name`. */
export function t(text, values = {}) {
  return (GERMAN[text] ?? text).replace(/\{(\w+)\}/g, (whole, name) => values[name] ?? whole);
}

/** All that the page's own HTML says, in place; then it may be seen. */
export function translate(root = document.documentElement) {
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
  root.classList.remove("untold");
}
