/**
 * Every setting of a preset as a form, generated from its JSON Schema: meaning, unit, range, default. What is changed
 * becomes an override of the mission.
 */
import { getPresetSettings } from "../api.js";
import { element, setText } from "../format.js";
import { overrideText, sectionsOf } from "../settings-form.js";

const FIRST = ["limits", "planner", "robot", "sensor.camera", "mapping"];
/** What has a field of its own in the form, is drawn on the map, or is no setting. */
const HIDDEN = new Set([
  "description",
  "clock",
  "planner.method",
  "sensor.camera.method",
  "directives.region",
  "directives.no_go",
]);

class SettingsEditor extends HTMLElement {
  /** Text by path of what differs from the preset. */
  overrides = new Map();

  connectedCallback() {
    this.filter = element("input", {
      type: "search",
      id: "settings-filter",
      placeholder: "Find a setting …",
      "aria-label": "Find a setting",
    });
    this.filter.addEventListener("input", (event) => {
      event.stopPropagation();
      this.#find();
    });
    this.planner = element("select", { id: "settings-planner" });
    this.planner.addEventListener("change", () => this.#choosePlanner());
    this.count = element("p", { class: "hint", id: "settings-changed", role: "status" });
    this.sections = element("div", { class: "sections" });
    this.append(
      element("label", { for: "settings-planner" }, "Planner", this.planner),
      this.filter,
      this.count,
      this.sections,
    );
  }

  /** Show the settings of `preset`; changes to another one are dropped. Raises what the service refuses. */
  async load(preset) {
    if (preset === this.preset) return;
    this.preset = preset;
    this.overrides.clear();
    await this.#fetch(null);
  }

  /** Mark what was refused, `{field: "overrides.PATH", message}`, and open its section. Returns the others. */
  showErrors(errors) {
    for (const marked of this.querySelectorAll("[aria-invalid=true]")) this.#judge(marked, "");
    const placed = errors.filter(({ field, message }) => {
      const input = this.#inputOf(field.replace(/^overrides\./, ""));
      if (!input) return false;
      this.#judge(input, message ?? "not allowed");
      input.closest("details").open = true;
      return true;
    });
    if (placed.length > 0) this.#inputOf(placed[0].field.replace(/^overrides\./, "")).focus();
    return errors.filter((error) => !placed.includes(error));
  }

  get valid() {
    return this.querySelector("[aria-invalid=true]") === null;
  }

  #inputOf(path) {
    return this.querySelector(`[data-path="${CSS.escape(path)}"]`);
  }

  async #fetch(planner) {
    const { preset } = this;
    const settings = await getPresetSettings(preset, planner);
    if (preset !== this.preset) return;
    if (planner === null) {
      this.planner.replaceChildren(
        element("option", { value: "" }, "the preset's"),
        ...settings.planners.map((name) => element("option", { value: name }, name)),
      );
    }
    const sections = sectionsOf(settings.settings_schema, settings.values);
    const rank = ({ name }) => (FIRST.indexOf(name) + 1 || FIRST.length + 1) + (name ? 0 : 1);
    sections.sort((a, b) => rank(a) - rank(b));
    this.sections.replaceChildren(...sections.map((section) => this.#section(section)));
    this.#find();
    this.#tell();
  }

  async #choosePlanner() {
    this.overrides.clear();
    if (this.planner.value) this.overrides.set("planner", this.planner.value);
    await this.#fetch(this.planner.value || null);
  }

  #section({ name, description, fields }) {
    const shown = fields.filter(({ path }) => !HIDDEN.has(path));
    return element(
      "details",
      { class: "section", hidden: shown.length === 0, "data-name": name },
      element("summary", {}, name || "whole mission"),
      ...(description ? [element("p", { class: "hint" }, description)] : []),
      ...shown.map((field) => this.#field(field)),
    );
  }

  #field(field) {
    const id = `setting-${field.path}`;
    const input = control(field, id);
    const problem = element("small", { class: "problem" });
    const reset = element("button", { type: "button", class: "reset", title: "Back to the preset's", hidden: true }, "↺");
    const row = element(
      "div",
      { class: "setting", "data-words": `${field.path} ${field.title} ${field.description}`.toLowerCase() },
      element("label", { for: id }, field.title, ...unit(field)),
      input,
      reset,
      element("small", { class: "meaning", id: `${id}-meaning` }, meaning(field)),
      problem,
    );
    input.dataset.path = field.path;
    input.setAttribute("aria-describedby", `${id}-meaning`);
    const take = () => {
      const text = read(input, field);
      const same = text === overrideText(field.value ?? null);
      if (same) this.overrides.delete(field.path);
      else this.overrides.set(field.path, text);
      reset.hidden = same;
      row.classList.toggle("changed", !same);
      this.#judge(input, same ? "" : wrong(text, field));
      this.#tell();
    };
    input.addEventListener("input", take);
    reset.addEventListener("click", () => {
      write(input, field);
      take();
      input.dispatchEvent(new Event("input", { bubbles: true }));
      input.focus();
    });
    return row;
  }

  #judge(input, message) {
    input.setAttribute("aria-invalid", String(message !== ""));
    setText(input.closest(".setting").querySelector(".problem"), message);
  }

  #tell() {
    const n = this.overrides.size;
    setText(this.count, n === 0 ? "As the preset says." : `${n} changed from the preset.`);
  }

  #find() {
    const wanted = this.filter.value.trim().toLowerCase();
    for (const section of this.sections.children) {
      const rows = [...section.querySelectorAll(".setting")];
      for (const row of rows) row.hidden = wanted !== "" && !row.dataset.words.includes(wanted);
      section.hidden = rows.every((row) => row.hidden);
      if (wanted) section.open = !section.hidden;
    }
  }
}

function control(field, id) {
  const { kind, choices, minimum, maximum } = field;
  const attributes = { id, "aria-invalid": "false" };
  let input;
  if (kind === "boolean" || choices) {
    const options = choices ?? [true, false];
    input = element("select", attributes, ...options.map((value) => element("option", { value }, String(value))));
  } else if (kind === "text") {
    input = element("input", { ...attributes, type: "text", maxlength: 500 });
  } else {
    const step = kind === "integer" ? 1 : "any";
    input = element("input", { ...attributes, type: "number", min: minimum, max: maximum, step });
  }
  write(input, field);
  return input;
}

function write(input, { value }) {
  input.value = value === null || value === undefined ? "" : textOf(value);
}

/** Lists are written as YAML reads them. */
const textOf = (value) => (Array.isArray(value) ? `[${value.join(", ")}]` : String(value));

/** The override's text; an emptied field that may be without a value is `null`. */
function read(input, { value, nullable }) {
  if (input.value === "" && nullable) return "null";
  return Array.isArray(value) && input.value === textOf(value) ? overrideText(value) : input.value;
}

/** What this page can tell is wrong; the service has the last word. */
function wrong(text, { kind, minimum, maximum, exclusive, nullable }) {
  if (text === "null" && nullable) return "";
  if (kind !== "number" && kind !== "integer") return "";
  const value = Number(text);
  if (text.trim() === "" || !Number.isFinite(value)) return "a number is needed";
  if (kind === "integer" && !Number.isInteger(value)) return "a whole number is needed";
  if (minimum !== undefined && (exclusive ? value <= minimum : value < minimum))
    return `must be ${exclusive ? "greater than" : "at least"} ${minimum}`;
  if (maximum !== undefined && value > maximum) return `must be at most ${maximum}`;
  return "";
}

const unit = ({ unit: name }) => (name ? [element("span", { class: "unit" }, ` ${name}`)] : []);

function meaning({ description, minimum, maximum, exclusive, value }) {
  const range = [];
  if (minimum !== undefined) range.push(`${exclusive ? ">" : "≥"} ${minimum}`);
  if (maximum !== undefined) range.push(`≤ ${maximum}`);
  const preset = value === null || value === undefined ? "none" : textOf(value);
  return [description, `Preset: ${preset}${range.length ? `; ${range.join(", ")}` : ""}.`].filter(Boolean).join(" ");
}

customElements.define("settings-editor", SettingsEditor);
