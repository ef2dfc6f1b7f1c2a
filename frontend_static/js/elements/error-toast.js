/** Errors that belong to no field of a form, until they are dismissed. */
import { element } from "../format.js";
import { store } from "../store.js";

class ErrorToast extends HTMLElement {
  connectedCallback() {
    this.setAttribute("role", "alert");
    this.listen = (event) => this.#show(event.detail);
    store.addEventListener("problem", this.listen);
  }

  disconnectedCallback() {
    store.removeEventListener("problem", this.listen);
  }

  #show(message) {
    const dismiss = element("button", { type: "button", "aria-label": "Dismiss" }, "✕");
    dismiss.addEventListener("click", () => this.replaceChildren());
    this.replaceChildren(element("div", {}, element("p", {}, message), dismiss));
  }
}

customElements.define("error-toast", ErrorToast);
