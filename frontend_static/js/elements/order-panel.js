/** Orders to the running mission: areas, budgets, approval of views. They hold once they are sent. */
import { element, setText } from "../format.js";
import { Part } from "../observable.js";
import { MOST_NO_GO, orders } from "../orders.js";
import { store } from "../store.js";

const NUMBERS = [
  ["max_speed_m_s", "Speed limit", "m/s", "none"],
  ["max_path_m", "Path budget", "m", "none"],
];
const SWITCHES = [
  ["return_to_start", "Return to start", "Within the path budget, and when nothing is left to see"],
  ["approve_views", "Approve every view", "The mission waits for your word before it drives to a new view"],
];

class OrderPanel extends Part {
  connectedCallback() {
    this.areas = element("ul", { "aria-label": "Areas" });
    this.noAreas = element("p", { class: "empty" }, "No areas: draw them on the map with Region and No-go.");
    this.inputs = {};
    const numbers = NUMBERS.map((settings) => this.#number(settings));
    const switches = SWITCHES.map((settings) => this.#switch(settings));
    this.problem = element("p", { class: "problem", role: "alert" });
    this.state = element("p", { class: "hint", id: "orders-state", role: "status" });
    this.revert = element("button", { type: "button", id: "revert-orders", onclick: () => orders.revert() }, "Revert");
    this.send = element("button", { type: "submit", id: "send-orders", class: "primary" }, "Send orders");
    const form = element(
      "form",
      { autocomplete: "off", novalidate: true },
      element("h3", {}, "Areas"),
      this.areas,
      this.noAreas,
      element("h3", {}, "Budgets"),
      ...numbers,
      ...switches,
      this.problem,
      this.state,
      element("div", { class: "buttons" }, this.revert, this.send),
    );
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.#send();
    });
    this.append(form);
    this.follow(orders, ["draft", "in force"], () => this.#draw());
    this.follow(store, ["mission", "session"], () => this.#draw());
  }

  #number([field, title, unit, without]) {
    const input = element("input", {
      id: `order-${field}`,
      name: field,
      type: "number",
      min: 0,
      step: "any",
      placeholder: without,
    });
    input.addEventListener("input", () => {
      this.typing = field;
      orders.edit({ [field]: input.value === "" ? null : Number(input.value) });
      this.typing = null;
    });
    this.inputs[field] = input;
    return element("label", { for: input.id }, `${title} (${unit})`, input);
  }

  #switch([field, title, hint]) {
    const input = element("input", { id: `order-${field}`, name: field, type: "checkbox" });
    input.addEventListener("change", () => orders.edit({ [field]: input.checked }));
    this.inputs[field] = input;
    return element("label", { class: "switch-row", for: input.id }, input, element("span", {}, title, element("small", {}, hint)));
  }

  async #send() {
    try {
      await orders.send();
      setText(this.problem, "");
    } catch (error) {
      setText(this.problem, error.status === 404 || error.status === 405 ? "This service takes no orders." : error.message);
    }
  }

  #draw() {
    const { draft, possible, changedHere, errors, sending } = orders;
    this.#drawAreas(draft, possible);
    for (const [field, input] of Object.entries(this.inputs)) {
      if (input.type === "checkbox") input.checked = draft[field];
      else if (this.typing !== field) input.value = draft[field] ?? "";
      input.disabled = !possible;
      const refused = errors.some(({ field: name }) => name.split(".").includes(field));
      input.setAttribute("aria-invalid", String(refused));
    }
    if (errors.length === 0) setText(this.problem, "");
    this.send.disabled = !possible || !changedHere || sending;
    this.revert.disabled = !changedHere || sending;
    this.send.classList.toggle("due", changedHere);
    setText(this.state, this.#words(possible, changedHere));
  }

  #words(possible, changedHere) {
    if (!store.mission) return "No mission.";
    if (!store.operator) return "Viewers watch; orders need an operator.";
    if (!possible) return "The mission has ended: these were its orders.";
    return changedHere ? "Changed here, not sent yet: drawn dashed on the map." : "In force.";
  }

  #drawAreas({ region, no_go: areas }, possible) {
    const all = areas.map((corners, index) => [`No-go ${index + 1}`, { kind: "no_go", index }, corners]);
    if (region) all.unshift(["Region of interest", { kind: "region", index: 0 }, region]);
    this.noAreas.hidden = all.length > 0;
    const key = JSON.stringify([all.map(([title, , corners]) => [title, corners.length]), possible]);
    if (key === this.drawnAreas) return;
    this.drawnAreas = key;
    this.areas.replaceChildren(...all.map(([title, target, corners]) => area(title, target, corners, possible)));
    this.areas.title = areas.length >= MOST_NO_GO ? `There are at most ${MOST_NO_GO} no-go areas.` : "";
  }
}

function area(title, target, corners, possible) {
  const map = () => document.querySelector("top-view");
  const change = element("button", { type: "button", disabled: !possible, "aria-label": `Change ${title}` }, "Change");
  change.addEventListener("click", () => {
    document.getElementById("stage-map").click();
    map().editor.select(target);
    map().canvas.focus();
  });
  const remove = element("button", { type: "button", disabled: !possible, "aria-label": `Remove ${title}` }, "✕");
  remove.addEventListener("click", () => {
    map().editor.select(null);
    orders.setPolygon(target, null);
  });
  return element(
    "li",
    { "data-kind": target.kind },
    element("span", { class: "swatch", "aria-hidden": "true" }),
    element("span", {}, title, element("small", {}, `${corners.length} corners`)),
    change,
    remove,
  );
}

customElements.define("order-panel", OrderPanel);
