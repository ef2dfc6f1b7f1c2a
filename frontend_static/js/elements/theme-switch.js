/** Light, dark, or as the system says. */
import { element, setText } from "../format.js";
import { Part } from "../observable.js";
import { chosenTheme, nextTheme, themes } from "../theme.js";

const LOOKS = { system: ["◐", "as the system says"], light: ["☀", "light"], dark: ["☾", "dark"] };

class ThemeSwitch extends Part {
  connectedCallback() {
    this.button = element("button", { type: "button", id: "theme", class: "quiet icon", onclick: nextTheme });
    this.append(this.button);
    this.hear(themes, "theme", () => this.#draw());
    this.#draw();
  }

  #draw() {
    const [glyph, words] = LOOKS[chosenTheme()];
    setText(this.button, glyph);
    this.button.title = `Colours: ${words}`;
    this.button.setAttribute("aria-label", this.button.title);
  }
}

customElements.define("theme-switch", ThemeSwitch);
