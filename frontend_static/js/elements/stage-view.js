/** The map from above, the 3D scene, or both beside each other. */
import { element } from "../format.js";

const KEY = "hgs-stage";
const MODES = [
  ["map", "Map"],
  ["both", "Both"],
  ["3d", "3D"],
];
const WIDE_PX = 1500;

class StageView extends HTMLElement {
  connectedCallback() {
    this.map = document.createElement("top-view");
    this.scene = document.createElement("scene-frame");
    this.buttons = MODES.map(([mode, title]) =>
      element("button", { type: "button", id: `stage-${mode}`, onclick: () => this.#choose(mode) }, title),
    );
    this.append(
      element("div", { class: "switch", role: "group", "aria-label": "What the stage shows" }, ...this.buttons),
      element("div", { class: "panes" }, this.map, this.scene),
    );
    const kept = localStorage.getItem(KEY);
    this.#show(MODES.some(([mode]) => mode === kept) ? kept : innerWidth >= WIDE_PX ? "both" : "map");
  }

  #choose(mode) {
    localStorage.setItem(KEY, mode);
    this.#show(mode);
  }

  #show(mode) {
    this.buttons.forEach((button, k) => button.setAttribute("aria-pressed", String(MODES[k][0] === mode)));
    this.map.hidden = mode === "3d";
    this.scene.hidden = mode === "map";
    this.scene.seen = mode !== "map";
  }
}

customElements.define("stage-view", StageView);
