/** What the marks of the map mean; closed until it is asked for. */
import { element } from "../format.js";

const MARKS = [
  ["trajectory", "way driven, from the square"],
  ["path", "next: local path"],
  ["tour", "after that: global tour"],
  ["selected", "chosen view, looking along the stroke"],
  ["crossing", "view on the way"],
  ["below", "too little gain"],
  ["unreachable", "no safe path"],
  ["reconstructing", "subspace under way"],
  ["unreconstructed", "subspace not seen yet"],
  ["region", "region of interest"],
  ["no-go", "no-go area; dashed: not sent yet"],
];

class MapLegend extends HTMLElement {
  connectedCallback() {
    this.append(
      element(
        "details",
        {},
        element("summary", {}, "Legend"),
        element(
          "ul",
          {},
          ...MARKS.map(([mark, meaning]) =>
            element("li", {}, element("i", { class: `mark ${mark}`, "aria-hidden": "true" }), meaning),
          ),
        ),
      ),
    );
  }
}

customElements.define("map-legend", MapLegend);
