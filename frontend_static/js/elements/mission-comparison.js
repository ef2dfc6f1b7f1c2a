/** Two missions beside each other: figures with differences, coverage curves, ways on one map, images. */
import * as api from "../api.js";
import { CHARTS } from "../charts.js";
import { element } from "../format.js";
import { FIGURES, compared } from "../comparison-figures.js";
import { missions } from "../missions.js";
import { Part } from "../observable.js";
import { report, store } from "../store.js";

const SIDES = [
  { name: "A", colour: "--series-1", dash: [] },
  { name: "B", colour: "--series-2", dash: [7, 4] },
];
const KINDS = [
  ["observed", "Observed"],
  ["rendered", "Rendered"],
  ["depth", "Depth"],
  ["quality", "Quality gain"],
];
const CURVES = CHARTS.filter(({ field }) => ["coverage", "missing_volume_m3", "psnr_current_db"].includes(field));

class MissionComparison extends Part {
  /** What is known of each side: `{mission, report, metrics, map}`; null: none chosen. */
  sides = [null, null];

  connectedCallback() {
    this.pickers = SIDES.map(({ name }, k) => {
      const picker = element("select", { id: `compare-${name.toLowerCase()}`, "aria-label": `Mission ${name}` });
      picker.addEventListener("change", () => this.#load(k, picker.value).catch(report));
      return picker;
    });
    this.table = element("table", { id: "compare-figures", "aria-label": "Figures side by side" });
    this.map = document.createElement("comparison-map");
    this.charts = element("div", { class: "charts" });
    this.curves = CURVES.map(({ title, format }) => {
      const chart = document.createElement("line-chart");
      this.charts.append(chart);
      chart.configure({ title, format });
      return chart;
    });
    this.images = element("div", { class: "images" });
    this.append(
      element("header", {}, ...SIDES.map((side, k) => this.#head(side, k))),
      element(
        "div",
        { class: "parts" },
        panel("Figures", this.table),
        panel("Ways driven", this.map),
        panel("Over the path", this.charts),
        panel("Last view", this.images),
      ),
    );
    this.follow(missions, ["missions"], () => this.#fill());
  }

  /** Called when the comparison comes to be seen: the shown mission against the one before it. */
  open() {
    this.#fill();
    const first = store.mission?.id ?? missions.entries[0]?.id;
    const second = missions.entries.find(({ id, started_at: began }) => id !== first && began)?.id;
    for (const [k, id] of [first, second].entries()) {
      if (this.pickers[k].value || !id) continue;
      this.pickers[k].value = id;
    }
    this.pickers.forEach((picker, k) => picker.value && this.#load(k, picker.value).catch(report));
  }

  #head({ name }, k) {
    return element(
      "label",
      { class: "side", "data-side": name, for: this.pickers[k].id },
      element("span", { class: "swatch", "aria-hidden": "true" }),
      name,
      this.pickers[k],
    );
  }

  #fill() {
    const entries = missions.entries.map(({ id, scene, preset, seed, state, created_at: at }) => {
      const time = new Date(at * 1000).toLocaleString([], { dateStyle: "short", timeStyle: "short" });
      return [id, `${scene} · ${preset} · seed ${seed} · ${state} · ${time}`];
    });
    const key = JSON.stringify(entries);
    if (key === this.listed) return;
    this.listed = key;
    for (const picker of this.pickers) {
      const { value } = picker;
      picker.replaceChildren(
        element("option", { value: "" }, "choose a mission"),
        ...entries.map(([id, text]) => element("option", { value: id }, text)),
      );
      picker.value = value;
    }
  }

  async #load(k, id) {
    this.sides[k] = null;
    if (id) {
      const mission = await api.getMission(id);
      const [outcome, metrics, map] = await Promise.all([
        mission.ended_at ? api.getReport(id) : null,
        api.getMetrics(id, 0),
        mission.view_sequence > 0 ? topView(id) : null,
      ]);
      if (this.pickers[k].value !== id) return;
      this.sides[k] = { mission, report: outcome, metrics: metrics.columns, map };
    }
    this.#draw();
  }

  #draw() {
    const { sides } = this;
    this.table.replaceChildren(heads(), element("tbody", {}, ...FIGURES.map((figure) => row(figure, sides))));
    this.map.show(sides.map((side) => side?.map ?? null));
    CURVES.forEach(({ read }, c) => {
      const lines = sides.flatMap((side, k) =>
        side ? [{ ...SIDES[k], xs: side.metrics.path_length_m, ys: read(side.metrics) }] : [],
      );
      this.curves[c].setData(lines, { xUnit: "m" });
    });
    this.images.replaceChildren(
      ...sides.flatMap((side, k) => KINDS.map(([kind, title]) => lastView(kind, title, side, SIDES[k].name))),
    );
  }
}

const panel = (title, ...children) => element("section", { class: "panel" }, element("h2", {}, title), ...children);

async function topView(id) {
  const [facts, answer] = await Promise.all([api.getTopView(id), fetch(api.topViewUrl(id))]);
  return { facts, image: await createImageBitmap(await answer.blob()) };
}

function heads() {
  const head = (text) => element("th", { scope: "col" }, text);
  return element("thead", {}, element("tr", {}, head("Figure"), head("A"), head("B"), head("B − A")));
}

function row({ title, unit, read, format }, sides) {
  const values = sides.map((side) => (side ? read(side) : null));
  const { text, verdict } = compared(title, values);
  return element(
    "tr",
    {},
    element("th", { scope: "row" }, title, ...(unit ? [element("small", {}, ` ${unit}`)] : [])),
    ...values.map((value) => element("td", {}, format(value))),
    element("td", { class: `verdict ${verdict}` }, text),
  );
}

function lastView(kind, title, side, name) {
  const src = side?.map ? api.imageUrl(side.mission.id, kind) : null;
  const image = element("img", { alt: `${title}, mission ${name}`, src });
  return element("figure", {}, element("div", { class: "picture" }, image), element("figcaption", {}, `${name} · ${title}`));
}

customElements.define("mission-comparison", MissionComparison);
