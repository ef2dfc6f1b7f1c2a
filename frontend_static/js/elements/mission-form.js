/** Create and start a mission. */
import { element } from "../format.js";
import { missions } from "../missions.js";
import { Part } from "../observable.js";
import { report, store } from "../store.js";

class MissionForm extends Part {
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
    this.settings = document.createElement("settings-editor");
    this.more = element("details", { class: "wide all-settings" }, element("summary", {}, "All settings"), this.settings);
    this.more.addEventListener("toggle", () => this.#loadSettings());
    this.hint = element("p", { class: "hint" });
    this.problem = element("p", { class: "problem", role: "alert" });
    this.submit = element("button", { type: "submit", class: "primary wide", id: "launch" }, "Start mission");
    const form = element(
      "form",
      { autocomplete: "off", novalidate: true },
      field("Scene", this.scene, "wide"),
      field("Preset", this.preset, "wide"),
      field("Seed", this.seed),
      field("Time limit (s)", this.limit),
      field("Clock", this.clock, "wide"),
      this.hint,
      this.more,
      this.problem,
      this.submit,
    );
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.#launch();
    });
    this.preset.addEventListener("change", () => {
      this.#presetClock();
      this.#loadSettings();
    });
    form.addEventListener("input", () => {
      this.key = crypto.randomUUID();
      this.#drawHint();
    });
    this.key = crypto.randomUUID();
    this.append(form);
    this.follow(store, ["catalogue"], () => this.#fill());
    this.follow(store, ["mission", "session"], () => this.#drawButton());
    this.follow(missions, ["missions"], () => this.#drawButton());
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

  /** Changes count for the preset that they were made to. */
  get #overrides() {
    return this.settings.preset === this.preset.value ? Object.fromEntries(this.settings.overrides) : {};
  }

  #presetClock() {
    const preset = store.presets.find(({ name }) => name === this.preset.value);
    this.clock.value = preset?.content.clock ?? "lockstep";
  }

  /** Settings are asked for once they are to be seen. */
  async #loadSettings() {
    if (!this.more.open || !this.preset.value) return;
    try {
      await this.settings.load(this.preset.value);
    } catch (error) {
      report(error);
    }
  }

  #drawHint() {
    const preset = store.presets.find(({ name }) => name === this.preset.value);
    const scene = store.scenes.find(({ name }) => name === this.scene.value);
    this.preset.title = preset?.description ?? "";
    this.scene.title = scene?.description ?? "";
    this.hint.textContent = preset?.description ?? "";
  }

  #drawButton() {
    const full = missions.running.length >= missions.atOnce || missions.queued.length > 0;
    this.submit.disabled = Boolean(this.launching || !store.operator);
    this.submit.textContent = full ? "Queue mission" : "Start mission";
    this.submit.title = store.operator
      ? full
        ? `Starts when a place is free; ${missions.queued.length} ahead of it`
        : ""
      : "Viewers watch; starting needs an operator";
  }

  async #launch() {
    this.problem.textContent = "";
    for (const input of [this.scene, this.preset, this.seed, this.limit, this.clock]) input.removeAttribute("aria-invalid");
    if (![this.seed, this.limit].every((input) => input.reportValidity())) return;
    if (this.more.open && !this.settings.valid) {
      this.problem.textContent = "A setting below is not allowed.";
      this.settings.querySelector("[aria-invalid=true]").focus();
      return;
    }
    const wish = {
      scene: this.scene.value,
      preset: this.preset.value,
      seed: Number(this.seed.value),
      clock: this.clock.value,
      overrides: this.#overrides,
    };
    if (this.limit.value !== "") wish.max_time_s = Number(this.limit.value);
    this.launching = true;
    this.#drawButton();
    try {
      await store.launch(wish, this.key);
      this.key = crypto.randomUUID();
    } catch (error) {
      this.problem.textContent = error.message;
      for (const { field: name } of this.settings.showErrors(error.errors ?? []))
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
