/** One quantity over another, of one mission or several, on a canvas: labelled scales, the value under the pointer. */
import { element, isNumber, setText } from "../format.js";
import { niceScale, short, ticksUpTo } from "../scale.js";
import { themes } from "../theme.js";
import { Part } from "../observable.js";

const LEFT = 40;
const BOTTOM = 17;
const TOP = 6;
const RIGHT = 10;
const TICK_PX = 60;

class LineChart extends Part {
  series = [];
  pointer = null;

  /** `{title, format}`: `format` makes text, with its unit, of a value. */
  configure({ title, format }) {
    this.settings = { title, format };
    this.caption = element("span", {}, title);
    this.value = element("b");
    this.canvas = element("canvas", { role: "img" });
    this.replaceChildren(element("div", { class: "title" }, this.caption, this.value), this.canvas);
    this.canvas.addEventListener("pointermove", (event) => this.#point(event.offsetX));
    this.canvas.addEventListener("pointerdown", (event) => this.#point(event.offsetX));
    this.canvas.addEventListener("pointerleave", () => this.#point(null));
    this.observer = new ResizeObserver(() => this.#schedule());
    this.observer.observe(this.canvas);
    this.hear(themes, "theme", () => this.#schedule());
  }

  disconnectedCallback() {
    super.disconnectedCallback();
    this.observer?.disconnect();
  }

  /**
   * Show lines `{name, colour, dash, xs, ys}`, `colour` a custom property; entries that are no numbers leave a gap.
   * `end`: where the horizontal axis ends at least; `mark`: a place on it to be marked.
   */
  setData(series, { xUnit, end = 0, mark = null }) {
    this.series = series.map((line) => ({
      ...line,
      points: line.xs.map((x, k) => [x, line.ys[k]]).filter(([x, y]) => isNumber(x) && isNumber(y)),
    }));
    [this.xUnit, this.end, this.mark] = [xUnit, end, mark];
    this.#schedule();
  }

  #point(offset) {
    this.pointer = offset;
    this.#schedule();
  }

  #schedule() {
    if (this.scheduled) return;
    this.scheduled = true;
    requestAnimationFrame(() => {
      this.scheduled = false;
      this.#draw();
    });
  }

  #draw() {
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight];
    if (width < 40 || height < 30) return;
    const ratio = devicePixelRatio || 1;
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
    const pen = this.canvas.getContext("2d");
    pen.scale(ratio, ratio);
    const style = getComputedStyle(this);
    pen.font = `10.5px ${style.fontFamily}`;
    pen.textBaseline = "middle";
    const drawn = this.series.filter(({ points }) => points.length > 0);
    if (drawn.length === 0) {
      setText(this.value, "–");
      pen.fillStyle = style.getPropertyValue("--ink-soft");
      pen.textAlign = "center";
      pen.fillText("no data yet", width / 2, height / 2);
      this.#describe(drawn);
      return;
    }
    const scales = this.#scales(drawn, width, height);
    drawAxes(pen, scales, style, this.xUnit, [width, height]);
    if (isNumber(this.mark)) this.#drawUpright(pen, this.mark, scales, [width, height], "--past");
    for (const line of drawn) drawLine(pen, line, scales, style);
    const at = isNumber(this.pointer) ? scales.xAt(this.pointer) : this.mark;
    if (isNumber(this.pointer)) this.#drawUpright(pen, nearest(drawn[0].points, at)[0], scales, [width, height], "--ink");
    this.#tell(pen, drawn, at, scales, style);
    this.#describe(drawn);
  }

  #scales(drawn, width, height) {
    const all = drawn.flatMap(({ points }) => points);
    const least = all.reduce((low, [, y]) => Math.min(low, y), Infinity);
    const most = all.reduce((high, [, y]) => Math.max(high, y), -Infinity);
    const y = niceScale(least, most, height > 150 ? 5 : 3);
    const xEnd = Math.max(this.end, ...drawn.map(({ points }) => points.at(-1)[0]), 1e-6);
    const inner = width - LEFT - RIGHT;
    return {
      y,
      xTicks: ticksUpTo(xEnd, Math.max(2, Math.floor(inner / TICK_PX))),
      xOf: (x) => LEFT + (x / xEnd) * inner,
      xAt: (u) => ((u - LEFT) / inner) * xEnd,
      yOf: (value) => TOP + (1 - (value - y.low) / (y.high - y.low)) * (height - TOP - BOTTOM),
    };
  }

  /** The values at `at` (or the newest) in the head of the chart, and where they lie. */
  #tell(pen, drawn, at, scales, style) {
    const { format } = this.settings;
    const asked = isNumber(at);
    const found = drawn.map((line) => ({ ...line, at: asked ? nearest(line.points, at) : line.points.at(-1) }));
    for (const line of found) {
      pen.fillStyle = style.getPropertyValue(line.colour);
      pen.beginPath();
      pen.arc(scales.xOf(line.at[0]), scales.yOf(line.at[1]), 3, 0, 2 * Math.PI);
      pen.fill();
    }
    const values = found.map((line) => (found.length > 1 ? `${line.name} ${format(line.at[1])}` : format(line.at[1])));
    setText(this.value, values.join(", "));
  }

  /** A line at `x`, and what `x` is. */
  #drawUpright(pen, x, { xOf }, [width, height], colour) {
    const style = getComputedStyle(this);
    const u = xOf(x);
    pen.strokeStyle = style.getPropertyValue(colour);
    pen.lineWidth = 1.5;
    pen.beginPath();
    pen.moveTo(u, TOP);
    pen.lineTo(u, height - BOTTOM);
    pen.stroke();
    const text = `${short(x)} ${this.xUnit}`;
    const right = u + pen.measureText(text).width + 8 > width;
    pen.textAlign = right ? "right" : "left";
    pen.fillStyle = style.getPropertyValue("--panel");
    pen.fillRect(right ? u - pen.measureText(text).width - 6 : u + 2, height - BOTTOM - 14, pen.measureText(text).width + 4, 12);
    pen.fillStyle = style.getPropertyValue(colour);
    pen.fillText(text, right ? u - 4 : u + 4, height - BOTTOM - 7);
  }

  #describe(drawn) {
    const { title, format } = this.settings;
    const values = drawn.map(({ name, points }) => `${name ? `${name} ` : ""}${format(points.at(-1)[1])}`);
    this.canvas.setAttribute("aria-label", `${title}: ${values.join(", ") || "no data yet"}`);
  }
}

function drawAxes(pen, { y, yOf, xTicks, xOf }, style, unit, [width, height]) {
  pen.strokeStyle = style.getPropertyValue("--line");
  pen.fillStyle = style.getPropertyValue("--ink-soft");
  pen.lineWidth = 1;
  pen.textAlign = "right";
  for (const tick of y.ticks) {
    const v = Math.round(yOf(tick)) + 0.5;
    pen.beginPath();
    pen.moveTo(LEFT, v);
    pen.lineTo(width - RIGHT, v);
    pen.stroke();
    pen.fillText(short(tick), LEFT - 5, v);
  }
  xTicks.forEach((tick, k) => {
    const u = Math.round(xOf(tick)) + 0.5;
    pen.beginPath();
    pen.moveTo(u, height - BOTTOM);
    pen.lineTo(u, height - BOTTOM + 3);
    pen.stroke();
    const last = k === xTicks.length - 1;
    pen.textAlign = last && u > width - 24 ? "right" : "center";
    pen.fillText(last ? `${short(tick)} ${unit}` : short(tick), last && u > width - 24 ? width : u, height - 7);
  });
}

function drawLine(pen, { points, colour, dash = [] }, { xOf, yOf }, style) {
  pen.strokeStyle = style.getPropertyValue(colour);
  pen.lineWidth = 1.75;
  pen.lineJoin = "round";
  pen.setLineDash(dash);
  pen.beginPath();
  points.forEach(([x, y], k) => (k ? pen.lineTo(xOf(x), yOf(y)) : pen.moveTo(xOf(x), yOf(y))));
  pen.stroke();
  pen.setLineDash([]);
}

function nearest(points, x) {
  let best = points[0];
  for (const point of points) if (Math.abs(point[0] - x) < Math.abs(best[0] - x)) best = point;
  return best;
}

customElements.define("line-chart", LineChart);
