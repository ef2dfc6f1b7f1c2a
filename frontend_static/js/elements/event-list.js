/** What happened, newest first. */
import { clock, element } from "../format.js";
import { store, watch } from "../store.js";

class EventList extends HTMLElement {
  connectedCallback() {
    this.list = element("ol");
    this.empty = element("p", { class: "empty" }, "Nothing has happened yet.");
    this.append(this.list, this.empty);
    this.unwatch = watch(["events"], () => this.#draw());
  }

  disconnectedCallback() {
    this.unwatch();
  }

  #draw() {
    const entries = [...store.events].reverse();
    this.empty.hidden = entries.length > 0;
    const newest = entries[0]?.sequence;
    const known = this.newest && entries.findIndex(({ sequence }) => sequence === this.newest);
    if (known > 0 && this.mission === store.mission?.id) {
      this.list.prepend(...entries.slice(0, known).map(entry));
      while (this.list.childElementCount > entries.length) this.list.lastElementChild.remove();
    } else if (known !== 0 || this.mission !== store.mission?.id) {
      this.list.replaceChildren(...entries.map(entry));
    }
    this.newest = newest;
    this.mission = store.mission?.id;
  }
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
    default:
      return [event.kind, "", ""];
  }
}

customElements.define("event-list", EventList);
