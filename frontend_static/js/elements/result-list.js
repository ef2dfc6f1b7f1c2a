/** Files that the mission left behind. */
import { archiveUrl, resultUrl } from "../api.js";
import { bytes, element } from "../format.js";
import { Part } from "../observable.js";
import { store } from "../store.js";

class ResultList extends Part {
  connectedCallback() {
    this.follow(store, ["results", "mission"], () => this.#draw());
  }

  #draw() {
    const { results, mission } = store;
    if (!mission || results.length === 0) {
      const text = store.active ? "Results are written when the mission ends." : "No results.";
      this.replaceChildren(element("p", { class: "empty" }, text));
      return;
    }
    const written = results.some(({ name }) => name !== "process.log");
    const everything = element(
      "a",
      { class: "button primary", id: "download-all", href: archiveUrl(mission.id), download: true },
      "Download everything (ZIP)",
    );
    const note = store.active ? "The mission is still under way: more is written when it ends." : "";
    this.replaceChildren(
      element("div", { class: "all" }, ...(written ? [everything] : []), element("p", { class: "hint" }, note)),
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
