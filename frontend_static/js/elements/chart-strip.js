/** Progress over path or time: small multiples that share their horizontal axis. */
import { element } from "../format.js";
import { Part } from "../observable.js";
import { CHARTS, planningOver } from "../charts.js";
import { store } from "../store.js";
import { timeline } from "../timeline.js";

const AXES = { path_length_m: ["path", "m"], time_s: ["time", "s"] };

class ChartStrip extends Part {
  connectedCallback() {
    this.buttons = Object.entries(AXES).map(([field, [name]]) =>
      element("button", { type: "button", "data-field": field, onclick: () => this.#choose(field) }, name),
    );
    const charts = element("div", { class: "charts" });
    this.append(
      element("div", { class: "switch", role: "group", "aria-label": "Horizontal axis" }, "over", ...this.buttons),
      charts,
    );
    this.charts = CHARTS.map(({ title, format, field }) => {
      const chart = document.createElement("line-chart");
      chart.dataset.field = field;
      charts.append(chart);
      chart.configure({ title, format });
      return chart;
    });
    this.#choose("path_length_m");
    this.follow(store, ["series"], () => this.#draw());
    this.follow(timeline, ["moment"], () => this.#draw());
  }

  #choose(field) {
    this.axis = field;
    for (const button of this.buttons) button.setAttribute("aria-pressed", String(button.dataset.field === field));
    this.#draw();
  }

  #draw() {
    const { series, planSeries } = store;
    const xs = series[this.axis];
    const view = { xUnit: AXES[this.axis][1], end: xs.at(-1) ?? 0, mark: timeline.moment?.[this.axis] ?? null };
    CHARTS.forEach(({ field, colour, read }, k) => {
      const line =
        field === "planning_s" ? planningOver(this.axis, series, planSeries) : { xs, ys: read(series) };
      this.charts[k].setData([{ name: "", colour, ...line }], view);
    });
  }
}

customElements.define("chart-strip", ChartStrip);
