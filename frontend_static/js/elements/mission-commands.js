/** Pause, resume and the STOP button. Space pauses and resumes, Shift+S stops. */
import { element } from "../format.js";
import { Part } from "../observable.js";
import { report, store } from "../store.js";

const OCTAGON =
  '<svg viewBox="0 0 16 16" aria-hidden="true"><path d="M5 0h6l5 5v6l-5 5H5l-5-5V5z"/></svg>';

/** Where letters are text. */
const WRITTEN = "textarea, input:not([type=number], [type=range], [type=checkbox])";

class MissionCommands extends Part {
  connectedCallback() {
    this.start = element("button", { type: "button", id: "start", class: "primary" }, "Start");
    this.toggle = element("button", { type: "button", id: "pause", title: "Space" }, "Pause");
    this.stop = element("button", { type: "button", id: "stop", class: "stop", title: "Shift+S" });
    this.stop.innerHTML = `${OCTAGON}<span>STOP</span>`;
    this.append(this.start, this.toggle, this.stop);
    this.start.addEventListener("click", () => this.#send("start"));
    this.toggle.addEventListener("click", () => this.#toggle());
    this.stop.addEventListener("click", () => this.#send("stop"));
    this.hear(document, "keydown", (event) => this.#key(event));
    this.follow(store, ["mission", "session"], () => this.#draw());
  }

  #draw() {
    const state = store.mission?.state;
    const commands = store.mission?.commands ?? [];
    const allowed = store.operator;
    this.start.hidden = state !== "created";
    this.start.disabled = !allowed;
    this.toggle.textContent = this.#resumes ? "Resume" : "Pause";
    this.toggle.disabled = !allowed || !(state === "running" || this.#resumes);
    // STOP passes whatever this page believes about the state: only an ended mission cannot be stopped.
    this.stop.disabled = !allowed || (!store.active && !commands.includes("stop"));
    this.stop.title = allowed ? "Shift+S" : "Viewers watch; stopping needs an operator";
    this.stop.lastElementChild.textContent = state === "stopping" ? "STOPPING" : "STOP";
  }

  get #resumes() {
    return ["paused", "interrupted"].includes(store.mission?.state);
  }

  #toggle() {
    this.#send(this.#resumes ? "resume" : "pause");
  }

  async #send(command) {
    try {
      await store.command(command);
    } catch (error) {
      report(error);
    }
  }

  #key(event) {
    // STOP works wherever the focus is, but where a capital S is being typed.
    const at = event.target instanceof Element ? event.target : document.body;
    const typing = at.closest("input, select, textarea, button, a, [role=tab], summary, canvas");
    if (event.key === "S" && event.shiftKey && !at.matches(WRITTEN)) {
      event.preventDefault();
      if (!this.stop.disabled) this.#send("stop");
    } else if (event.key === " " && !typing && !this.toggle.disabled) {
      event.preventDefault();
      this.#toggle();
    }
  }
}

customElements.define("mission-commands", MissionCommands);
