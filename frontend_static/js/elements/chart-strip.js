/** Progress over path or time: small multiples that share their horizontal axis. */
import { count, element, fixed } from "../format.js";
import { store, watch } from "../store.js";

const CHARTS = [
  { field: "missing_volume_m3", title: "Missing volume", colour: "--series-2", format: (v) => `${fixed(v, 2)} m³` },
  { field: "observed_volume_m3", title: "Observed", colour: "--series-3", format: (v) => `${fixed(v, 1)} m³` },
  { field: "psnr_current_db", title: "PSNR now", colour: "--series-1", format: (v) => `${fixed(v, 1)} dB` },
  { field: "n_gaussians", title: "Gaussians", colour: "--series-4", format: (v) => count(v) },
];
const AXES = { path_length_m: ["path", "m"], time_s: ["time", "s"] };

class ChartStrip extends HTMLElement {
  connectedCallback() {
    this.axis = "path_length_m";
    this.buttons = Object.entries(AXES).map(([field, [name]]) =>
      element("button", { type: "button", "data-field": field, onclick: () => this.#choose(field) }, name),
    );
    const charts = element("div", { class: "charts" });
    this.append(element("div", { class: "axis-switch", role: "group", "aria-label": "Horizontal axis" }, "over", ...this.buttons), charts);
    this.charts = CHARTS.map((settings) => {
      const chart = document.createElement("line-chart");
      charts.append(chart);
      chart.configure(settings);
      return chart;
    });
    this.#choose(this.axis);
    this.unwatch = watch(["series"], () => this.#draw());
  }

  disconnectedCallback() {
    this.unwatch();
  }

  #choose(field) {
    this.axis = field;
    for (const button of this.buttons) button.setAttribute("aria-pressed", String(button.dataset.field === field));
    this.#draw();
  }

  #draw() {
    const unit = AXES[this.axis][1];
    CHARTS.forEach(({ field }, k) => this.charts[k].setData(store.series[this.axis], store.series[field], unit));
  }
}

customElements.define("chart-strip", ChartStrip);
