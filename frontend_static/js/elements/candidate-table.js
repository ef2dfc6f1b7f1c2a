/** Why this view: the candidates of the newest plan, ranked, with both gains and what became of each. */
import { element, fixed, gain } from "../format.js";
import { store, watch } from "../store.js";

const VERDICTS = {
  selected: ["●", "chosen"],
  crossing: ["◆", "on the way"],
  below_threshold: ["○", "too little gain"],
  unreachable: ["✕", "no safe path"],
};

class CandidateTable extends HTMLElement {
  connectedCallback() {
    this.unwatch = watch(["plan", "mission"], () => this.#draw());
  }

  disconnectedCallback() {
    this.unwatch();
  }

  #draw() {
    const plan = store.plan;
    if (plan === this.drawn && this.childElementCount) return;
    this.drawn = plan;
    if (!plan) {
      this.replaceChildren(element("p", { class: "empty" }, "No plan yet."));
      return;
    }
    const ranked = [...plan.candidates].sort((a, b) => b.total - a.total);
    const highest = Math.max(ranked[0]?.total ?? 0, 1e-9);
    const facts =
      `${plan.n_selected} of ${plan.n_candidates} candidates chosen · ` +
      `${fixed(plan.observed_share * 100, 0)} % of the surroundings observed · ` +
      `${plan.n_reconstructing} subspaces under way`;
    this.replaceChildren(
      element("p", { class: "why" }, plan.reason, element("small", {}, facts)),
      element(
        "table",
        {},
        element(
          "thead",
          {},
          element(
            "tr",
            {},
            element("th", { class: "words", scope: "col" }, "View"),
            element("th", { scope: "col" }, "Total"),
            element("th", { scope: "col" }, "Coverage", element("small", {}, plan.coverage_unit)),
            element("th", { scope: "col" }, "Quality", element("small", {}, "m²")),
            element("th", { class: "if-wide", scope: "col" }, "x, y (m)"),
            element("th", { class: "if-wide", scope: "col" }, "Yaw"),
          ),
        ),
        element("tbody", {}, ...ranked.map((candidate) => row(candidate, highest))),
      ),
    );
  }
}

function row(candidate, highest) {
  const [glyph, verdict] = VERDICTS[candidate.status] ?? ["?", candidate.status];
  const chosen = candidate.status === "selected" || candidate.status === "crossing";
  const bar = element("i");
  bar.style.width = `${Math.max(0, Math.min(100, (candidate.total / highest) * 100))}%`;
  const mark = element("span", { "aria-hidden": "true" }, `${glyph} `);
  return element(
    "tr",
    { class: chosen ? "chosen" : "rejected" },
    element("td", { class: "words" }, mark, verdict),
    element("td", {}, element("span", { class: "gain-bar", "aria-hidden": "true" }, bar), gain(candidate.total)),
    element("td", {}, gain(candidate.coverage)),
    element("td", {}, gain(candidate.quality)),
    element("td", { class: "if-wide" }, `${fixed(candidate.x_m, 1)}, ${fixed(candidate.y_m, 1)}`),
    element("td", { class: "if-wide" }, `${fixed(candidate.yaw_deg, 0)}°`),
  );
}

customElements.define("candidate-table", CandidateTable);
