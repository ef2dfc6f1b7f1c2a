/** The 3D scene, served by the viewer. */
import { sceneUrl } from "../api.js";
import { element, setText } from "../format.js";
import { store, watch } from "../store.js";

class SceneFrame extends HTMLElement {
  connectedCallback() {
    this.note = element("div", { class: "note", id: "scene-note" });
    this.append(this.note);
    this.unwatch = watch(["system", "mission", "figures"], () => this.#load());
    this.unwatchNote = watch(["system", "mission", "figures"], () => this.#drawNote());
  }

  disconnectedCallback() {
    this.unwatch();
    this.unwatchNote();
  }

  #load() {
    const id = this.#shown();
    if (id === this.loaded) return;
    this.loaded = id;
    this.frame?.remove();
    if (!id) return;
    this.frame = element("iframe", { src: sceneUrl(id), title: "3D scene", id: "scene-view" });
    this.prepend(this.frame);
  }

  /** The mission whose scene can be looked at; null when there is none yet. */
  #shown() {
    if (!store.system?.viewer || !store.mission) return null;
    return store.active || store.viewSequence > 0 ? store.mission.id : null;
  }

  #drawNote() {
    setText(this.note, this.#message());
  }

  #message() {
    if (!store.system) return "";
    if (!store.system.viewer) return "The 3D viewer is switched off.";
    if (!store.mission) return "The map appears here once a mission runs.";
    if (store.viewSequence > 0) return "";
    if (store.active) return "Preparing: the map appears with the first frame.";
    const { state } = store.mission;
    if (state === "created" || state === "queued") return "The map appears here once the mission runs.";
    return "This mission ended before it had a map.";
  }
}

customElements.define("scene-frame", SceneFrame);
