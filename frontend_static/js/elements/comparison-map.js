/** Two ways on one map from above: A drawn through, B dashed. */
import { element } from "../format.js";
import { Part } from "../observable.js";
import { themes } from "../theme.js";
import { MapCamera } from "../top-view/camera.js";
import { listenToGestures } from "../top-view/gestures.js";
import { drawGround, drawMap, drawScale } from "../top-view/layers.js";
import { penFor } from "../top-view/pen.js";

const LOOKS = [
  { name: "A", colour: "series-1", dash: [] },
  { name: "B", colour: "series-2", dash: [7, 4] },
];

class ComparisonMap extends Part {
  camera = new MapCamera();
  /** `{facts, image}` of each side, or null. */
  maps = [null, null];

  connectedCallback() {
    this.canvas = element("canvas", { role: "img", "aria-label": "The ways of both missions from above" });
    this.append(this.canvas);
    listenToGestures(this.canvas, {
      press: () => false,
      drag: () => {},
      release: () => {},
      pan: (du, dv) => this.#change(() => this.camera.pan(du, dv)),
      zoom: (factor, at) => this.#change(() => this.camera.zoom(factor, at)),
      tap: () => {},
      hover: () => {},
    });
    this.observer = new ResizeObserver(() => this.#fit());
    this.observer.observe(this.canvas);
    this.hear(themes, "theme", () => this.#draw());
  }

  disconnectedCallback() {
    super.disconnectedCallback();
    this.observer.disconnect();
  }

  show(maps) {
    this.maps = maps;
    this.#fit();
  }

  #change(act) {
    act();
    this.#draw();
  }

  /** Show all of both. */
  #fit() {
    const facts = this.maps.filter((map) => map !== null).map((map) => map.facts);
    [this.camera.width, this.camera.height] = [this.canvas.clientWidth, this.canvas.clientHeight];
    if (facts.length > 0) {
      const least = (k) => Math.min(...facts.map(({ lower_m: lower }) => lower[k]));
      const most = (k) => Math.max(...facts.map(({ upper_m: upper }) => upper[k]));
      this.camera.fit([least(0), least(1)], [most(0), most(1)]);
    }
    this.#draw();
  }

  #draw() {
    const pen = penFor(this.canvas, this.camera);
    if (!pen) return;
    drawGround(pen);
    drawMap(pen, this.maps.find((map) => map !== null) ?? null);
    this.maps.forEach((map, k) => {
      if (!map) return;
      const { name, colour, dash } = LOOKS[k];
      const way = map.facts.trajectory;
      pen.line(way, { colour, dash, width: 2.5 });
      if (way.length > 0) pen.label(name, way.at(-1), { colour });
    });
    drawScale(pen);
  }
}

customElements.define("comparison-map", ComparisonMap);
