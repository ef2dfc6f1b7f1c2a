/** State of the mission, its reason in words, and whether what is shown is fresh. */
import { element, setText } from "../format.js";
import { missions } from "../missions.js";
import { Part } from "../observable.js";
import { GLYPHS } from "../states.js";
import { store } from "../store.js";

const STALE_S = 6;

class MissionStatus extends Part {
  connectedCallback() {
    this.glyph = element("span", { "aria-hidden": "true" });
    this.word = element("span");
    this.pill = element("span", { class: "pill", id: "mission-state" }, this.glyph, this.word);
    this.reason = element("span", { class: "reason", id: "mission-reason" });
    this.badge = element("span", { class: "badge", role: "alert", id: "stale-badge", hidden: true });
    this.append(this.pill, this.reason, this.badge);
    this.follow(store, ["mission", "plan", "connection"], () => this.#draw());
    this.follow(missions, ["missions"], () => this.#draw());
    this.every(1000, () => this.#drawBadge());
  }

  #draw() {
    const state = store.mission?.state ?? "none";
    if (this.pill.dataset.state !== state) {
      this.pill.dataset.state = state;
      setText(document.getElementById("announcer"), `Mission ${state}`);
    }
    setText(this.glyph, GLYPHS[state] ?? "?");
    setText(this.word, state === "none" ? "no mission" : state);
    setText(this.reason, this.#reason(state));
    this.reason.title = this.reason.textContent;
    this.#drawBadge();
  }

  #reason(state) {
    if (!store.mission) return "Choose a scene and a preset under New, then start.";
    if (state === "queued") {
      const place = missions.placeOf(store.mission.id);
      return place ? `Number ${place} in the queue: ${store.mission.reason}` : store.mission.reason;
    }
    if (store.mission.approval) return "Waits for your word on the next view";
    if (state === "running" && store.plan) return store.plan.reason;
    return store.mission.reason;
  }

  #drawBadge() {
    const text = this.#complaint();
    setText(this.badge, text);
    this.badge.hidden = text === "";
  }

  #complaint() {
    if (!store.serviceReachable) return "Service does not answer";
    if (!store.connected) return "Connection lost, reconnecting";
    const moving = store.mission?.state === "running";
    if (moving && !store.mission.approval && store.silence > STALE_S)
      return `Stale: no data for ${Math.round(store.silence)} s`;
    return "";
  }
}

customElements.define("mission-status", MissionStatus);
