// Before anything is painted: the language, and light or dark. It is no module, because modules run after the first paint:
// a page would be seen in English, or bright, before it is seen as it was asked for.

(() => {
  const page = document.documentElement;
  const asked = localStorage.getItem("dlo-language") ?? navigator.language ?? "en";
  page.lang = asked.startsWith("de") ? "de" : "en";
  page.dataset.theme = localStorage.getItem("dlo-theme") ?? (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
  if (page.lang !== "de") return;
  page.classList.add("untold"); // not shown until it is translated (i18n.js), or that takes too long (style.css)
  document.head.append(Object.assign(document.createElement("link"), { rel: "modulepreload", href: "viewer/german.js" }));
})();
