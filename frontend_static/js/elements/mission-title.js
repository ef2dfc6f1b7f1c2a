/** Which mission is shown; opens the list of all. */
import { element, setText } from "../format.js";
import { Part } from "../observable.js";
import { store } from "../store.js";

class MissionTitle extends Part {
  connectedCallback() {
    this.name = element("b", { id: "mission-name" });
    this.facts = element("span", { class: "facts" });
    const open = element(
      "button",
      { type: "button", id: "open-missions", class: "quiet", title: "All missions", onclick: () => this.#open() },
      this.name,
      this.facts,
    );
    this.append(open);
    this.follow(store, ["mission"], () => this.#draw());
  }

  #open() {
    document.getElementById("side-tabs").select("missions");
    document.getElementById("tab-missions").focus();
  }

  #draw() {
    const { mission } = store;
    setText(this.name, mission ? mission.scene : "No mission");
    setText(this.facts, mission ? `${mission.preset} · seed ${mission.seed}` : "choose or start one");
    this.dataset.mission = mission?.id ?? "";
  }
}

customElements.define("mission-title", MissionTitle);
