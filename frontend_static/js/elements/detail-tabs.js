/** Candidates, events and results in one place; arrow keys move between the tabs. */
import { element, setText } from "../format.js";
import { store, watch } from "../store.js";

const TABS = [
  ["candidates", "Why this view", "candidate-table"],
  ["events", "Events", "event-list"],
  ["results", "Results", "result-list"],
];

class DetailTabs extends HTMLElement {
  connectedCallback() {
    this.tabs = TABS.map(([name, title], k) =>
      element(
        "button",
        {
          type: "button",
          role: "tab",
          id: `tab-${name}`,
          "aria-controls": `panel-${name}`,
          onclick: () => this.#select(k),
          onkeydown: (event) => this.#move(event, k),
        },
        title,
      ),
    );
    this.panels = TABS.map(([name, , tag]) =>
      element(
        "div",
        { role: "tabpanel", id: `panel-${name}`, "aria-labelledby": `tab-${name}`, tabindex: 0 },
        document.createElement(tag),
      ),
    );
    this.append(element("div", { role: "tablist" }, ...this.tabs), ...this.panels);
    this.#select(0);
    this.unwatch = watch(["results", "events"], () => {
      setText(this.tabs[2], store.results.length ? `Results (${store.results.length})` : "Results");
    });
  }

  disconnectedCallback() {
    this.unwatch();
  }

  #select(chosen) {
    this.tabs.forEach((tab, k) => {
      tab.setAttribute("aria-selected", String(k === chosen));
      tab.tabIndex = k === chosen ? 0 : -1;
      this.panels[k].hidden = k !== chosen;
    });
  }

  #move(event, from) {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!step) return;
    const next = (from + step + TABS.length) % TABS.length;
    this.#select(next);
    this.tabs[next].focus();
  }
}

customElements.define("detail-tabs", DetailTabs);
