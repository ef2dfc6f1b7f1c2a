/** The view that waits for the operator's word: where it is, what it gains, and the answers. */
import { element, fixed, gain, setText } from "../format.js";
import { Part } from "../observable.js";
import { orders } from "../orders.js";
import { report, store } from "../store.js";
import { view } from "../view.js";

class ApprovalBar extends Part {
  connectedCallback() {
    this.setAttribute("role", "region");
    this.setAttribute("aria-label", "Approve the next view");
    this.text = element("p", { role: "status" });
    this.other = element("select", { id: "approval-candidate", "aria-label": "Which view" });
    this.other.addEventListener("change", () => view.pointAt(this.#candidate));
    this.approve = element("button", { type: "button", id: "approve", class: "primary" }, "Drive there");
    this.reject = element("button", { type: "button", id: "reject" }, "Reject");
    this.approve.addEventListener("click", () => this.#answer("approve", this.#candidate));
    this.reject.addEventListener("click", () => this.#answer("reject"));
    this.append(this.text, this.other, this.approve, this.reject);
    this.follow(store, ["mission", "plan", "session"], () => this.#draw());
  }

  /** Place of the chosen candidate in the plan; null: the one that the mission proposes. */
  get #candidate() {
    return this.other.value === "" ? null : Number(this.other.value);
  }

  async #answer(decision, candidate = null) {
    try {
      await orders.answer(decision, candidate);
    } catch (error) {
      report(error);
    }
  }

  #draw() {
    const { waiting } = orders;
    this.hidden = waiting === null;
    if (!waiting) {
      this.asked = null;
      return;
    }
    for (const control of [this.other, this.approve, this.reject]) control.disabled = !store.operator;
    const { x_m: x, y_m: y } = waiting.view;
    setText(this.text, `The robot waits: next view at ${fixed(x, 1)}, ${fixed(y, 1)} m.`);
    if (this.asked === waiting.plan_sequence) return;
    this.asked = waiting.plan_sequence;
    const candidates = store.plan?.plan_sequence === waiting.plan_sequence ? store.plan.candidates : [];
    const others = candidates
      .map((candidate, place) => ({ candidate, place }))
      .filter(({ candidate }) => candidate.status !== "unreachable")
      .sort((a, b) => b.candidate.total - a.candidate.total);
    this.other.replaceChildren(
      element("option", { value: "" }, "the view proposed"),
      ...others.map(({ candidate, place }) =>
        element(
          "option",
          { value: place },
          `${fixed(candidate.x_m, 1)}, ${fixed(candidate.y_m, 1)} m: total ${gain(candidate.total)}`,
        ),
      ),
    );
  }
}

customElements.define("approval-bar", ApprovalBar);
