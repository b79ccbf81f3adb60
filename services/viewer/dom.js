// Elements of a page: found, made, filled. Text from the service enters as text, never as HTML.

import { t } from "./i18n.js";
import { titleOf } from "./problem_titles.js";

export const byId = (id) => document.getElementById(id);

export function element(tag, className = "", text = "", more = {}) {
  const made = document.createElement(tag);
  if (className) made.className = className;
  made.textContent = text;
  return Object.assign(made, more);
}

export function button(text, act, className = "") {
  const made = element("button", className, text, { type: "button" });
  made.addEventListener("click", act);
  return made;
}

/** Makes `rows` the children of a list that is made anew often. Those that are there already stay, or a click on one that
 *  comes meanwhile would be lost, and the focus. Rows that look alike are the same if they are `of` the same. */
export function refill(box, rows) {
  rows.forEach((row, k) => {
    const old = box.children[k];
    if (!old) box.append(row);
    else if (old.of !== row.of || !old.isEqualNode(row)) old.replaceWith(row);
  });
  while (box.children.length > rows.length) box.lastElementChild.remove();
}

/** A problem in the box, or none: what the service refused, with its fields, or what went wrong here. */
export function showProblem(problem, box = byId("error")) {
  box.hidden = !problem;
  if (!problem) return;
  const errors = problem.errors ?? [];
  const lang = problem.code ? "en" : document.documentElement.lang; // the service writes English
  box.replaceChildren(element("strong", "", titleOf(problem)), element("span", "", errors.length ? "" : problem.detail, { lang }));
  for (const { field, message } of errors) {
    const line = element("p", "", "", { lang });
    line.append(element("code", "", field), ` ${message}`);
    box.append(line);
  }
  if (problem.incident) box.append(element("p", "", t("incident {incident}", problem)));
}

/** Any error as a problem to show. */
export const problemOf = (error, title = "This did not work") =>
  error.problem ?? { title: t(title), detail: error.message, errors: [] };

export function download(blob, name) {
  const link = element("a", "", "", { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

/** Over plain HTTP from another machine a page has no clipboard: then the text is selected instead. */
export async function copy(from, source) {
  const before = from.textContent;
  try {
    await navigator.clipboard.writeText(source.textContent);
    from.textContent = t("Copied");
  } catch {
    getSelection().selectAllChildren(source);
    from.textContent = t("Selected");
  }
  setTimeout(() => (from.textContent = before), 1500);
}

/** Files that are dropped anywhere on the page. */
export function onDrop(take) {
  addEventListener("dragover", (event) => event.preventDefault());
  addEventListener("drop", (event) => {
    event.preventDefault();
    if (event.dataTransfer.files.length) take([...event.dataTransfer.files], event.dataTransfer);
  });
}

/** Whether a key press is meant for a field and not for the page. */
export const isTyping = ({ target }) =>
  target.isContentEditable || (/^(INPUT|SELECT|TEXTAREA)$/.test(target.tagName) && !/^(radio|checkbox|range|button)$/.test(target.type));
