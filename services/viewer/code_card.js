// A card with the page's request as code to copy: as a command, as a program, and as a recipe.

import { api } from "./api.js";
import { button, byId, copy, element } from "./dom.js";
import { t } from "./i18n.js";
import { curlOf, pythonOf, recipeOf } from "./snippets.js";

const FORMS = [["curl", "curl"], ["python", "Python"], ["recipe", "Recipe"]];

/** Fills the empty `details` element of a page. */
export function codeCard() {
  const card = byId("code");
  card.append(element("summary", "", t("This request as code")));
  for (const [id, name] of FORMS) {
    const [figure, caption] = [element("figure"), element("figcaption")];
    const shown = element("pre", "", "", { id, tabIndex: 0 });
    const copier = button(t("Copy"), () => copy(copier, shown));
    copier.dataset.copy = id;
    caption.append(element("span", "", t(name)), copier);
    figure.append(caption, shown);
    card.append(figure);
  }
  const save = element("a", "", t("Save as a recipe"), { id: "save-recipe", href: "viewer/recipes.html" });
  card.lastChild.append(save);
}

/** Shows a request with its files: their names by the part that each is. `name` is what a recipe is called. */
export function showCode(request, parts, name) {
  const base = new URL(".", document.baseURI).href.replace(/\/$/, "");
  const recipe = recipeOf(request, name);
  byId("curl").textContent = curlOf(request, parts, base, Boolean(api.key));
  byId("python").textContent = pythonOf(request, parts, base);
  byId("recipe").textContent = JSON.stringify(recipe, null, 2);
  byId("save-recipe").href = `viewer/recipes.html?body=${encodeURIComponent(JSON.stringify(recipe))}`;
}
