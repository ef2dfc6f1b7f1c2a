/** All missions, newest first: state, place in the queue, outcome; older ones page by page. */
import { clock, element, setText } from "../format.js";
import { missions } from "../missions.js";
import { Part } from "../observable.js";
import { GLYPHS } from "../states.js";
import { report, store } from "../store.js";

const FILTERS = {
  all: [],
  "running or waiting": ["created", "queued", "starting", "running", "paused", "stopping", "interrupted"],
  completed: ["completed"],
  "failed or aborted": ["failed", "aborted"],
};

class MissionList extends Part {
  connectedCallback() {
    this.filter = element(
      "select",
      { id: "mission-filter", "aria-label": "Which missions" },
      ...Object.keys(FILTERS).map((name) => element("option", { value: name }, name)),
    );
    this.filter.addEventListener("change", () => missions.show(FILTERS[this.filter.value]).catch(report));
    this.list = element("ul");
    this.empty = element("p", { class: "empty" }, "No missions.");
    this.more = element("button", { type: "button", id: "older-missions" }, "Older missions");
    this.more.addEventListener("click", () => missions.loadMore().catch(report));
    this.append(element("div", { class: "filters" }, this.filter), this.list, this.empty, this.more);
    this.follow(missions, ["missions"], () => this.#draw());
    this.follow(store, ["mission"], () => this.#draw());
  }

  #draw() {
    const { entries } = missions;
    this.empty.hidden = entries.length > 0;
    this.more.hidden = !missions.more;
    while (this.list.childElementCount > entries.length) this.list.lastElementChild.remove();
    while (this.list.childElementCount < entries.length) this.list.append(row());
    entries.forEach((mission, k) => fill(this.list.children[k], mission));
  }
}

/** Rows are filled anew, never replaced, so that the focus stays where it is. */
function row() {
  const made = element(
    "li",
    {},
    element(
      "button",
      { type: "button" },
      element("span", { class: "pill" }),
      element("b", { class: "what" }),
      element("span", { class: "when" }),
      element("span", { class: "reason" }),
    ),
  );
  made.firstElementChild.addEventListener("click", () => {
    if (made.dataset.id !== store.mission?.id) store.show(made.dataset.id).catch(report);
  });
  return made;
}

function fill(item, mission) {
  const shown = mission.id === store.mission?.id;
  const [pill, what, when, reason] = item.firstElementChild.children;
  item.dataset.id = mission.id;
  if (shown) item.firstElementChild.setAttribute("aria-current", "true");
  else item.firstElementChild.removeAttribute("aria-current");
  pill.dataset.state = mission.state;
  setText(pill, `${GLYPHS[mission.state] ?? "?"} ${mission.state}`);
  setText(what, `${mission.scene} · ${mission.preset} · seed ${mission.seed}`);
  setText(when, time(mission));
  const place = missions.placeOf(mission.id);
  setText(reason, place ? `Number ${place} in the queue` : mission.reason);
  reason.title = mission.reason;
}

function time({ created_at: created, started_at: started, ended_at: ended }) {
  const began = new Date((started ?? created) * 1000);
  const day = began.toLocaleDateString([], { month: "short", day: "numeric" });
  const hour = began.toLocaleTimeString([], { hour: "2-digit", minute: "2-digit", hour12: false });
  return ended && started ? `${day} ${hour}, took ${clock(ended - started)}` : `${day} ${hour}`;
}

customElements.define("mission-list", MissionList);
