/** Create and start a mission. */
import { element } from "../format.js";
import { store, watch } from "../store.js";

class MissionForm extends HTMLElement {
  connectedCallback() {
    this.scene = element("select", { name: "scene", id: "scene" });
    this.preset = element("select", { name: "preset", id: "preset" });
    this.seed = element("input", {
      name: "seed",
      id: "seed",
      type: "number",
      min: 0,
      max: 2147483647,
      step: 1,
      value: 0,
      required: true,
    });
    this.limit = element("input", {
      name: "max_time_s",
      id: "max-time",
      type: "number",
      min: 1,
      step: "any",
      placeholder: "none",
    });
    this.clock = element(
      "select",
      {
        name: "clock",
        id: "clock",
        title: "Lockstep repeats exactly; in real time mapper and planner must keep up with the robot",
      },
      element("option", { value: "lockstep" }, "lockstep"),
      element("option", { value: "real" }, "real time"),
    );
    this.hint = element("p", { class: "hint" });
    this.problem = element("p", { class: "problem", role: "alert" });
    this.submit = element("button", { type: "submit", class: "primary wide", id: "launch" }, "Start mission");
    const form = element(
      "form",
      { autocomplete: "off" },
      field("Scene", this.scene, "wide"),
      field("Preset", this.preset, "wide"),
      field("Seed", this.seed),
      field("Time limit (s)", this.limit),
      field("Clock", this.clock, "wide"),
      this.hint,
      this.problem,
      this.submit,
    );
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.#launch();
    });
    this.preset.addEventListener("change", () => this.#presetClock());
    form.addEventListener("input", () => {
      this.key = crypto.randomUUID();
      this.#drawHint();
    });
    this.key = crypto.randomUUID();
    this.append(form);
    this.unwatch = watch(["catalogue"], () => this.#fill());
    this.unwatchState = watch(["missions", "mission", "session"], () => this.#drawButton());
  }

  disconnectedCallback() {
    this.unwatch();
    this.unwatchState();
  }

  #fill() {
    this.scene.replaceChildren(
      ...store.scenes.map(({ name }) => element("option", { value: name }, name)),
    );
    this.preset.replaceChildren(
      ...store.presets.map(({ name }) => element("option", { value: name }, name)),
    );
    if (store.presets.some(({ name }) => name === "paper")) this.preset.value = "paper";
    this.#presetClock();
    this.#drawHint();
  }

  #presetClock() {
    const preset = store.presets.find(({ name }) => name === this.preset.value);
    this.clock.value = preset?.content.clock ?? "lockstep";
  }

  #drawHint() {
    const preset = store.presets.find(({ name }) => name === this.preset.value);
    const scene = store.scenes.find(({ name }) => name === this.scene.value);
    this.preset.title = preset?.description ?? "";
    this.scene.title = scene?.description ?? "";
    this.hint.textContent = preset?.description ?? "";
  }

  #drawButton() {
    const full = store.running.length >= store.missionsAtOnce || store.queued.length > 0;
    this.submit.disabled = Boolean(this.launching || !store.operator);
    this.submit.textContent = full ? "Queue mission" : "Start mission";
    this.submit.title = store.operator
      ? full
        ? `Starts when a place is free; ${store.queued.length} ahead of it`
        : ""
      : "Viewers watch; starting needs an operator";
  }

  async #launch() {
    this.problem.textContent = "";
    for (const input of this.querySelectorAll("[aria-invalid]")) input.removeAttribute("aria-invalid");
    const wish = {
      scene: this.scene.value,
      preset: this.preset.value,
      seed: Number(this.seed.value),
      clock: this.clock.value,
    };
    if (this.limit.value !== "") wish.max_time_s = Number(this.limit.value);
    this.launching = true;
    this.#drawButton();
    try {
      await store.launch(wish, this.key);
      this.key = crypto.randomUUID();
    } catch (error) {
      this.problem.textContent = error.message;
      for (const { field: name } of error.errors ?? [])
        this.querySelector(`[name="${CSS.escape(name)}"]`)?.setAttribute("aria-invalid", "true");
    } finally {
      this.launching = false;
      this.#drawButton();
    }
  }
}

function field(text, input, className = "") {
  return element("label", { class: className, for: input.id }, text, input);
}

customElements.define("mission-form", MissionForm);
