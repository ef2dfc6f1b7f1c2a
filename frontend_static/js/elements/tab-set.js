/**
 * Tabs over its children, which say `data-name` and `data-title`; arrow keys, Home and End move between them. Which one
 * was chosen is kept in this browser under the id of the set.
 */
import { element, setText } from "../format.js";

class TabSet extends HTMLElement {
  connectedCallback() {
    this.panels = [...this.children];
    this.tabs = this.panels.map((panel, k) => this.#tab(panel, k));
    this.prepend(element("div", { role: "tablist", "aria-label": this.getAttribute("label") }, ...this.tabs));
    const kept = this.panels.findIndex(({ dataset }) => dataset.name === localStorage.getItem(this.#key));
    this.#select(Math.max(0, kept));
  }

  get #key() {
    return `hgs-tab-${this.id}`;
  }

  select(name) {
    const place = this.panels.findIndex(({ dataset }) => dataset.name === name);
    if (place >= 0) this.#select(place);
  }

  /** Put `note` behind the title of a tab: how many there are. */
  setNote(name, note) {
    const place = this.panels.findIndex(({ dataset }) => dataset.name === name);
    const { title } = this.panels[place].dataset;
    setText(this.tabs[place], note ? `${title} (${note})` : title);
  }

  #tab(panel, place) {
    const { name, title } = panel.dataset;
    panel.id = `panel-${name}`;
    panel.setAttribute("role", "tabpanel");
    panel.setAttribute("aria-labelledby", `tab-${name}`);
    panel.tabIndex = 0;
    return element(
      "button",
      {
        type: "button",
        role: "tab",
        id: `tab-${name}`,
        "aria-controls": panel.id,
        onclick: () => this.#select(place),
        onkeydown: (event) => this.#move(event, place),
      },
      title,
    );
  }

  #select(chosen) {
    this.tabs.forEach((tab, k) => {
      tab.setAttribute("aria-selected", String(k === chosen));
      tab.tabIndex = k === chosen ? 0 : -1;
      this.panels[k].hidden = k !== chosen;
    });
    localStorage.setItem(this.#key, this.panels[chosen].dataset.name);
  }

  #move(event, from) {
    const last = this.tabs.length - 1;
    const next = {
      ArrowRight: from === last ? 0 : from + 1,
      ArrowLeft: from === 0 ? last : from - 1,
      Home: 0,
      End: last,
    }[event.key];
    if (next === undefined) return;
    event.preventDefault();
    this.#select(next);
    this.tabs[next].focus();
  }
}

customElements.define("tab-set", TabSet);
