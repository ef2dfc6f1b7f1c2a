/** Which mission is shown. */
import { element } from "../format.js";
import { report, store, watch } from "../store.js";

class MissionPicker extends HTMLElement {
  connectedCallback() {
    this.select = element("select", { "aria-label": "Mission shown", id: "mission-picker" });
    this.select.addEventListener("change", () => store.show(this.select.value).catch(report));
    this.append(this.select);
    this.unwatch = watch(["missions", "mission"], () => this.#draw());
  }

  disconnectedCallback() {
    this.unwatch();
  }

  #draw() {
    const entries = store.missions.map((mission) => {
      const began = new Date((mission.started_at ?? mission.created_at) * 1000);
      const time = began.toLocaleTimeString([], { hour: "2-digit", minute: "2-digit", hour12: false });
      const waits = store.queued.indexOf(mission.id) + 1;
      const note = waits ? `queued ${waits}: ` : store.running.includes(mission.id) ? "▶ " : "";
      const text = `${note}${time} ${mission.scene} · ${mission.preset} · seed ${mission.seed}`;
      return { id: mission.id, text };
    });
    const signature = JSON.stringify(entries);
    if (signature !== this.signature && document.activeElement !== this.select) {
      this.signature = signature;
      this.select.replaceChildren(
        ...(entries.length
          ? entries.map(({ id, text }) => element("option", { value: id }, text))
          : [element("option", { value: "" }, "No missions yet")]),
      );
    }
    this.select.disabled = entries.length === 0;
    if (store.mission) this.select.value = store.mission.id;
  }
}

customElements.define("mission-picker", MissionPicker);
