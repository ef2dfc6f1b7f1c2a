/** The 3D scene, served by the viewer. */
import { element, setText } from "../format.js";
import { store, watch } from "../store.js";

class SceneFrame extends HTMLElement {
  connectedCallback() {
    this.note = element("div", { class: "note", id: "scene-note" });
    this.append(this.note);
    this.unwatch = watch(["system"], () => this.#load());
    this.unwatchNote = watch(["system", "missions", "mission", "figures"], () => this.#drawNote());
  }

  disconnectedCallback() {
    this.unwatch();
    this.unwatchNote();
  }

  #load() {
    const url = store.system?.viewer_url;
    if (!url || this.frame) return;
    this.frame = element("iframe", { src: url, title: "3D scene", id: "scene-view" });
    this.prepend(this.frame);
  }

  #drawNote() {
    setText(this.note, this.#message());
  }

  #message() {
    if (!store.system) return "";
    if (!store.system.viewer_url) return "The 3D viewer is switched off.";
    if (!store.mission) return "The map appears here once a mission runs.";
    const { state, id } = store.mission;
    if (state === "starting") return "Preparing: the map appears with the first frame.";
    if (store.inScene && store.inScene !== id)
      return "The 3D scene shows the mission that ran last, not this one.";
    return "";
  }
}

customElements.define("scene-frame", SceneFrame);
