/** Operating one mission, or comparing two; STOP stays in the bar above either. */
import { element } from "../format.js";

class ViewSwitch extends HTMLElement {
  connectedCallback() {
    this.button = element("button", { type: "button", id: "compare", "aria-pressed": "false" }, "Compare");
    this.button.addEventListener("click", () => this.#turn());
    this.append(this.button);
  }

  #turn() {
    const comparing = this.button.getAttribute("aria-pressed") !== "true";
    this.button.setAttribute("aria-pressed", String(comparing));
    document.querySelector("main.board").hidden = comparing;
    const comparison = document.querySelector("mission-comparison");
    comparison.hidden = !comparing;
    if (comparing) comparison.open();
  }
}

customElements.define("view-switch", ViewSwitch);
