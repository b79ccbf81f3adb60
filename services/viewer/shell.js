// What all pages share: navigation, the API key, language, light and dark, and whether the service is ready.

import { api } from "./api.js";
import { button, element } from "./dom.js";
import { choose, language, t, translate } from "./i18n.js";

const PAGES = [
  ["Pictures", "./", "index"],
  ["Harness", "viewer/harness.html", "harness"],
  ["3D", "viewer/reconstruction.html", "reconstruction"],
  ["Tracks", "viewer/tracks.html", "tracks"],
  ["Label", "viewer/label.html", "label"],
  ["Recipes", "viewer/recipes.html", "recipes"],
  ["Jobs", "viewer/jobs.html", "jobs"],
];
const THEME = "dlo-theme";

/** Builds the head of the page, into which no page writes itself. `onKey` is called when another key was entered. */
export function shell(onKey = () => {}) {
  translate();
  const head = document.querySelector(".shell");
  head.append(brand(), navigation(), pill(), keyButton(onKey), languages(), themeButton());
  watchService();
}

/** The networks of the live workers, once they are known; asked for once a page. */
export let networks = Promise.resolve([]);

function watchService() {
  networks = api.networks().then(
    (all) => (state(all.length ? "ready" : "no worker yet", all.length ? "good" : ""), all),
    (error) => (state(error.problem?.status === 401 ? "needs an API key" : "not reachable", "bad"), []),
  );
  networks.then((all) => document.dispatchEvent(new CustomEvent("networks", { detail: all })));
}

function state(text, className) {
  const shown = document.getElementById("service");
  shown.textContent = t(text);
  shown.className = `pill ${className}`;
}

function brand() {
  const link = element("a", "brand", "", { href: "./" });
  link.append(element("img", "", "", { src: "viewer/icon.svg", alt: "", width: 26, height: 26 }), element("span", "", "DLO"));
  link.setAttribute("aria-label", t("DLO, start"));
  return link;
}

function navigation() {
  const nav = element("nav");
  nav.setAttribute("aria-label", t("Pages"));
  const here = location.pathname.match(/viewer\/(\w+)\.html$/)?.[1] ?? "index";
  for (const [name, href, file] of PAGES) {
    const link = element("a", "", t(name), { href });
    if (file === here) link.setAttribute("aria-current", "page");
    nav.append(link);
  }
  nav.append(element("a", "", "API", { href: "docs" }));
  return nav;
}

function pill() {
  const shown = element("span", "pill", t("connecting …"), { id: "service" });
  shown.setAttribute("role", "status");
  return shown;
}

/** The key is kept while the tab is open, or on this machine where somebody wants that. */
function keyButton(onKey) {
  const dialog = element("dialog");
  dialog.setAttribute("aria-label", t("API key"));
  const field = element("input", "", "", { id: "key", type: "password", autocomplete: "off", value: api.key });
  field.placeholder = t("if the service asks");
  const keep = element("input", "", "", { type: "checkbox", checked: api.keepsKey() });
  const form = element("form", "", "", { method: "dialog" });
  const [named, kept] = [element("label", "", t("API key")), element("label", "check")];
  named.append(field);
  kept.append(keep, t("remember it on this machine"));
  form.append(named, kept, element("button", "primary", t("Use it"), { id: "use-key" }));
  dialog.append(form);
  form.addEventListener("submit", () => {
    api.setKey(field.value.trim(), keep.checked);
    watchService();
    onKey();
  });
  const opener = button(t("Key"), () => dialog.showModal());
  opener.id = "open-key";
  document.body.append(dialog);
  return opener;
}

function languages() {
  const select = element("select", "", "", { id: "language" });
  select.setAttribute("aria-label", t("Language"));
  select.append(new Option("English", "en"), new Option("Deutsch", "de"));
  select.value = language();
  select.addEventListener("change", () => choose(select.value));
  return select;
}

/** What first.js found is turned over. */
function themeButton() {
  const shown = document.documentElement.dataset;
  const sign = () => (shown.theme === "dark" ? "☀" : "☾");
  const turn = button(sign(), () => {
    shown.theme = shown.theme === "dark" ? "light" : "dark";
    localStorage.setItem(THEME, shown.theme);
    turn.textContent = sign();
    dispatchEvent(new Event("resize")); // canvases draw with colors of their own
  });
  turn.id = "theme";
  turn.setAttribute("aria-label", t("Light or dark"));
  return turn;
}
