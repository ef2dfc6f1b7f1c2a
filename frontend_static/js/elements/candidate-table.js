/** Why this view: the candidates of the plan, ranked, with both gains and what became of each. */
import { element, fixed, gain } from "../format.js";
import { Part } from "../observable.js";
import { view } from "../view.js";

const VERDICTS = {
  selected: ["●", "chosen"],
  crossing: ["◆", "on the way"],
  below_threshold: ["○", "too little gain"],
  unreachable: ["✕", "no safe path"],
};

class CandidateTable extends Part {
  connectedCallback() {
    this.addEventListener("pointerleave", () => view.pointAt(null));
    this.follow(view, ["plan", "mission"], () => this.#draw());
    this.follow(view, ["pointed"], () => this.#point());
  }

  #draw() {
    const { plan } = view;
    if (plan === this.drawn && this.childElementCount) return;
    this.drawn = plan;
    if (!plan) {
      this.replaceChildren(element("p", { class: "empty" }, "No plan yet."));
      return;
    }
    const ranked = plan.candidates
      .map((candidate, place) => ({ candidate, place }))
      .sort((a, b) => b.candidate.total - a.candidate.total);
    const highest = Math.max(ranked[0]?.candidate.total ?? 0, 1e-9);
    const facts =
      `${plan.n_selected} of ${plan.n_candidates} candidates chosen · ` +
      `${fixed(plan.observed_share * 100, 0)} % of the surroundings observed · ` +
      `${plan.n_reconstructing} subspaces under way`;
    const scrolled = this.parentElement?.scrollTop;
    this.replaceChildren(
      element("p", { class: "why" }, plan.reason, element("small", {}, facts)),
      element(
        "table",
        { "aria-label": "Candidates by total gain" },
        element("thead", {}, heads(plan.coverage_unit)),
        element("tbody", {}, ...ranked.map((entry) => row(entry, highest))),
      ),
    );
    if (scrolled) this.parentElement.scrollTop = scrolled;
    this.#point();
  }

  /** The row of the candidate that is pointed at, here or on the map. */
  #point() {
    for (const marked of this.querySelectorAll("tr.pointed")) marked.classList.remove("pointed");
    this.querySelector(`tr[data-place="${view.pointedAt}"]`)?.classList.add("pointed");
  }
}

function heads(coverageUnit) {
  const head = (title, unit, className = "") =>
    element("th", { class: className, scope: "col" }, title, ...(unit ? [element("small", {}, unit)] : []));
  return element(
    "tr",
    {},
    head("View", "", "words"),
    head("Total", ""),
    head("Coverage", coverageUnit),
    head("Quality", "m²"),
    head("x, y", "m", "if-wide"),
    head("Yaw", "", "if-wide"),
  );
}

function row({ candidate, place }, highest) {
  const [glyph, verdict] = VERDICTS[candidate.status] ?? ["?", candidate.status];
  const chosen = candidate.status === "selected" || candidate.status === "crossing";
  const bar = element("i");
  bar.style.width = `${Math.max(0, Math.min(100, (candidate.total / highest) * 100))}%`;
  const point = () => view.pointAt(place);
  return element(
    "tr",
    {
      class: chosen ? "chosen" : "rejected",
      "data-place": place,
      tabindex: 0,
      onpointerenter: point,
      onfocus: point,
      onblur: () => view.pointAt(null),
    },
    element(
      "td",
      { class: "words" },
      element("span", { "aria-hidden": "true" }, `${glyph} `),
      verdict,
      ...(candidate.why ? [element("small", { class: "because" }, candidate.why)] : []),
    ),
    element("td", {}, element("span", { class: "gain-bar", "aria-hidden": "true" }, bar), gain(candidate.total)),
    element("td", {}, gain(candidate.coverage)),
    element("td", {}, gain(candidate.quality)),
    element("td", { class: "if-wide" }, `${fixed(candidate.x_m, 1)}, ${fixed(candidate.y_m, 1)}`),
    element("td", { class: "if-wide" }, `${fixed(candidate.yaw_deg, 0)}°`),
  );
}

customElements.define("candidate-table", CandidateTable);
