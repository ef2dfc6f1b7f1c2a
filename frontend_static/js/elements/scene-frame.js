/** The 3D scene, served by the viewer. */
import { sceneUrl } from "../api.js";
import { element, setText } from "../format.js";
import { Part } from "../observable.js";
import { store } from "../store.js";

class SceneFrame extends Part {
  connectedCallback() {
    this.note = element("div", { class: "note", id: "scene-note" });
    this.append(this.note);
    this.follow(store, ["system", "mission", "figures"], () => this.#show());
  }

  /** The scene is loaded once it is to be seen: it costs the browser memory and time. */
  set seen(seen) {
    this.wanted = seen;
    if (this.isConnected) this.#show();
  }

  #show() {
    this.#load();
    setText(this.note, this.#message());
  }

  #load() {
    const id = this.#shown();
    if (id === this.loaded) return;
    this.loaded = id;
    this.frame?.remove();
    if (!id) return;
    this.frame = element("iframe", { src: sceneUrl(id), title: "3D scene", id: "scene-view" });
    // Keys belong to the scene while it has the focus; STOP is heard there, too.
    this.frame.addEventListener("load", ({ target }) => {
      target.contentWindow.addEventListener("keydown", ({ key, shiftKey, target: at }) => {
        if (key !== "S" || !shiftKey || at.closest?.("input, textarea")) return;
        document.dispatchEvent(new KeyboardEvent("keydown", { key, shiftKey, bubbles: true }));
      });
    });
    this.prepend(this.frame);
  }

  /** The mission whose scene can be looked at; null when there is none yet. */
  #shown() {
    if (!this.wanted || !store.system?.viewer || !store.mission) return null;
    return store.active || store.viewSequence > 0 ? store.mission.id : null;
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
