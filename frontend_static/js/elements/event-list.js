/** What happened, newest first: filtered by kind, level and text, older ones on request. */
import { clock, element, fixed, setText } from "../format.js";
import { Part } from "../observable.js";
import { report, store } from "../store.js";
import { view } from "../view.js";

const KINDS = {
  all: null,
  "state and phase": ["state", "phase", "halted", "resumed", "ended"],
  plans: ["plan"],
  notices: ["notice"],
  orders: ["directives", "approval"],
};
const LEVELS = { "any level": 0, "warnings and errors": 1, errors: 2 };
const RANKS = { warning: 1, error: 2 };
const MOST_SHOWN = 500;

class EventList extends Part {
  connectedCallback() {
    this.kind = choice("event-kind", "Kind of event", Object.keys(KINDS));
    this.level = choice("event-level", "Level", Object.keys(LEVELS));
    this.text = element("input", {
      id: "event-text",
      type: "search",
      placeholder: "Containing …",
      "aria-label": "Text in the event",
    });
    const filters = element("div", { class: "filters" }, this.kind, this.level, this.text);
    filters.addEventListener("input", () => this.#draw());
    this.list = element("ol");
    this.empty = element("p", { class: "empty" });
    this.more = element("button", { type: "button", id: "older-events" }, "Older events");
    this.more.addEventListener("click", () => store.loadOlderEvents().catch(report));
    this.append(filters, this.list, this.empty, this.more);
    this.follow(view, ["events", "mission"], () => this.#draw());
  }

  #draw() {
    const { events } = view;
    const found = events.filter((event) => this.#passes(event));
    const shown = found.slice(-MOST_SHOWN).reverse();
    this.more.hidden = !store.moreEvents;
    this.empty.hidden = shown.length > 0;
    setText(this.empty, events.length ? "No event passes the filters." : "Nothing has happened yet.");
    const keys = shown.map(({ sequence }) => `${store.mission.id} ${sequence}`);
    // Only what is new is added, so that a selection and the place of the scroll bar stay.
    const known = this.keys ? keys.indexOf(this.keys[0]) : -1;
    const goesOn = known >= 0 && this.keys.slice(0, keys.length - known).every((key, k) => key === keys[known + k]);
    if (goesOn && keys.length - known <= this.keys.length) {
      this.list.prepend(...shown.slice(0, known).map(entry));
      while (this.list.childElementCount > shown.length) this.list.lastElementChild.remove();
    } else {
      this.list.replaceChildren(...shown.map(entry));
    }
    this.keys = keys;
  }

  #passes(event) {
    const kinds = KINDS[this.kind.value];
    if (kinds && !kinds.includes(event.kind)) return false;
    const [kind, text, level] = describe(event);
    if ((RANKS[level] ?? 0) < LEVELS[this.level.value]) return false;
    const wanted = this.text.value.trim().toLowerCase();
    return !wanted || `${kind} ${text}`.toLowerCase().includes(wanted);
  }
}

function choice(id, label, names) {
  return element(
    "select",
    { id, "aria-label": label },
    ...names.map((name) => element("option", { value: name }, name)),
  );
}

function entry(event) {
  const [kind, text, level] = describe(event);
  const time =
    event.time_s === undefined
      ? new Date(event.received_at * 1000).toLocaleTimeString([], { hour12: false })
      : clock(event.time_s);
  return element(
    "li",
    { "data-level": level, "data-kind": event.kind },
    element("time", {}, time),
    element("span", { class: "kind" }, kind),
    element("span", { class: "text" }, text),
  );
}

/** `[kind, text, level]` for people. */
function describe(event) {
  switch (event.kind) {
    case "state":
      return [event.state, event.reason, event.state === "failed" ? "error" : ""];
    case "phase":
      return ["phase", `${event.phase}: ${event.reason}`, ""];
    case "plan":
      return ["plan", event.reason, ""];
    case "notice":
      return [event.level, event.message, event.level];
    case "ended":
      return ["ended", `${event.stop_reason}: ${event.message}`, ""];
    case "resumed":
      return ["resumed", event.reason, ""];
    case "halted":
      return ["halted", `the robot stands at ${fixed(event.x_m, 1)}, ${fixed(event.y_m, 1)} m`, ""];
    case "approval":
      return ["approval", `${event.state.replaceAll("_", " ")}, plan ${event.plan_sequence}: ${event.reason ?? ""}`, ""];
    case "directives":
      return ["orders", "the operator's orders are in force", ""];
    default:
      return [event.kind, "", ""];
  }
}

customElements.define("event-list", EventList);
