/** Files that the mission left behind. */
import { resultUrl } from "../api.js";
import { bytes, element } from "../format.js";
import { store, watch } from "../store.js";

class ResultList extends HTMLElement {
  connectedCallback() {
    this.unwatch = watch(["results", "mission"], () => this.#draw());
  }

  disconnectedCallback() {
    this.unwatch();
  }

  #draw() {
    const { results, mission } = store;
    if (!mission || results.length === 0) {
      const text = store.active ? "Results are written when the mission ends." : "No results.";
      this.replaceChildren(element("p", { class: "empty" }, text));
      return;
    }
    this.replaceChildren(
      element(
        "ul",
        {},
        ...results.map((file) =>
          element(
            "li",
            {},
            element("a", { href: resultUrl(mission.id, file.name), download: true }, file.name),
            element("span", {}, bytes(file.size_bytes)),
            element("span", {}, file.description),
          ),
        ),
      ),
    );
  }
}

customElements.define("result-list", ResultList);
