// Pictures to try, which come with the service: rendered, with nobody's rights in them.

import { element } from "./dom.js";
import { t } from "./i18n.js";

const PICTURES = {
  cables: ["plain.jpg", "busy.jpg", "industrial.jpg"],
  harness: ["harness.png", "harness_crossed.png"],
};

/** Buttons in `box`, each of which takes one of the pictures as if it had been chosen. */
export function offer(box, kind, take) {
  for (const name of PICTURES[kind]) {
    const made = element("button", "", "", { type: "button" });
    made.append(element("img", "", "", { src: `viewer/samples/${name}`, alt: "", loading: "lazy" }), element("span", "", name));
    made.setAttribute("aria-label", t("Try {name}", { name }));
    made.addEventListener("click", async () => {
      const blob = await (await fetch(`viewer/samples/${name}`)).blob();
      take([new File([blob], name, { type: blob.type })]);
    });
    box.append(made);
  }
}
