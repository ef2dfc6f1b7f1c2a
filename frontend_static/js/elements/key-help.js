/** What the keys do; `?` opens it. */
import { element } from "../format.js";
import { Part } from "../observable.js";

const KEYS = [
  ["Anywhere", [["Shift+S", "STOP"], ["Space", "pause, resume"], ["?", "this list"]]],
  [
    "Map from above",
    [
      ["Arrows, + −, 0", "move, zoom, show all"],
      ["Enter, C, Backspace", "while drawing: add a corner, close the area, take a corner back"],
      ["N, arrows, I, Del", "of a chosen area: next corner, move it, insert one, remove it"],
      ["Shift+Del, Esc", "remove the area, let go"],
    ],
  ],
  ["Timeline", [["← →", "a moment back, on"], ["Space", "play"], ["Esc", "back to the present"]]],
  ["Tabs", [["← → Home End", "another tab"]]],
];

class KeyHelp extends Part {
  connectedCallback() {
    const close = element("button", { type: "button", class: "primary" }, "Close");
    this.dialog = element("dialog", { id: "key-help", "aria-labelledby": "key-help-title" });
    this.dialog.append(
      element("h2", { id: "key-help-title" }, "Keys"),
      ...KEYS.map(([title, keys]) =>
        element(
          "section",
          {},
          element("h3", {}, title),
          element(
            "dl",
            {},
            ...keys.map(([key, what]) => element("div", {}, element("dt", {}, key), element("dd", {}, what))),
          ),
        ),
      ),
      close,
    );
    close.addEventListener("click", () => this.dialog.close());
    const open = element(
      "button",
      { type: "button", id: "open-keys", class: "quiet icon", title: "Keys (?)", "aria-label": "Keys" },
      "?",
    );
    open.addEventListener("click", () => this.dialog.show()); // not modal: STOP stays within reach
    this.append(open, this.dialog);
    this.hear(document, "keydown", (event) => {
      const typing = event.target instanceof Element && event.target.closest("input, select, textarea");
      if (event.key === "?" && !typing) this.dialog.show();
      else if (event.key === "Escape" && this.dialog.open) this.dialog.close();
    });
  }
}

customElements.define("key-help", KeyHelp);
