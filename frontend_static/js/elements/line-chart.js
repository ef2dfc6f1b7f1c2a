/** One quantity over another, on a canvas: a line, two labelled scales, the value under the pointer. */
import { element, isNumber, setText } from "../format.js";

const LEFT = 38;
const BOTTOM = 15;
const TOP = 6;
const RIGHT = 6;

class LineChart extends HTMLElement {
  /** `{title, colour, format}`: `colour` names a custom property, `format` makes text of a value. */
  configure({ title, colour, format }) {
    this.settings = { title, colour, format };
    this.caption = element("span", {}, title);
    this.value = element("b");
    this.canvas = element("canvas", { role: "img" });
    this.replaceChildren(element("div", { class: "title" }, this.caption, this.value), this.canvas);
    this.canvas.addEventListener("pointermove", (event) => {
      this.pointer = event.offsetX;
      this.#schedule();
    });
    this.canvas.addEventListener("pointerleave", () => {
      this.pointer = null;
      this.#schedule();
    });
    new ResizeObserver(() => this.#schedule()).observe(this.canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.#schedule());
  }

  /** Show `ys` over `xs`; entries that are no numbers leave a gap. */
  setData(xs, ys, xUnit) {
    this.xs = xs;
    this.ys = ys;
    this.xUnit = xUnit;
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
    const { xs = [], ys = [] } = this;
    const { format, title, colour } = this.settings;
    const width = this.canvas.clientWidth;
    const height = this.canvas.clientHeight;
    if (width < 40 || height < 30) return;
    const ratio = devicePixelRatio || 1;
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
    const pen = this.canvas.getContext("2d");
    pen.scale(ratio, ratio);
    const style = getComputedStyle(this);
    const ink = style.getPropertyValue("--ink-soft");
    const grid = style.getPropertyValue("--line");
    pen.font = `10px ${style.fontFamily}`;
    pen.textBaseline = "middle";

    const points = xs.map((x, k) => [x, ys[k]]).filter(([x, y]) => isNumber(x) && isNumber(y));
    const last = points.at(-1);
    setText(this.value, last ? format(last[1]) : "–");
    this.canvas.setAttribute("aria-label", `${title}: ${last ? format(last[1]) : "no data yet"}`);
    if (points.length === 0) {
      pen.fillStyle = ink;
      pen.textAlign = "center";
      pen.fillText("no data yet", width / 2, height / 2);
      return;
    }
    const yScale = niceScale(Math.min(...points.map((p) => p[1])), Math.max(...points.map((p) => p[1])), 3);
    const xEnd = Math.max(points.at(-1)[0], 1e-6);
    const xOf = (x) => LEFT + (x / xEnd) * (width - LEFT - RIGHT);
    const yOf = (y) => TOP + (1 - (y - yScale.low) / (yScale.high - yScale.low)) * (height - TOP - BOTTOM);

    pen.strokeStyle = grid;
    pen.fillStyle = ink;
    pen.lineWidth = 1;
    pen.textAlign = "right";
    for (const tick of yScale.ticks) {
      const y = Math.round(yOf(tick)) + 0.5;
      pen.beginPath();
      pen.moveTo(LEFT, y);
      pen.lineTo(width - RIGHT, y);
      pen.stroke();
      pen.fillText(short(tick), LEFT - 5, y);
    }
    pen.textAlign = "left";
    pen.fillText("0", LEFT, height - 6);
    pen.textAlign = "right";
    pen.fillText(`${short(xEnd)} ${this.xUnit}`, width - RIGHT, height - 6);

    pen.strokeStyle = style.getPropertyValue(colour);
    pen.lineWidth = 1.75;
    pen.lineJoin = "round";
    pen.beginPath();
    points.forEach(([x, y], k) => (k ? pen.lineTo(xOf(x), yOf(y)) : pen.moveTo(xOf(x), yOf(y))));
    pen.stroke();

    const marked = isNumber(this.pointer) ? nearest(points, ((this.pointer - LEFT) / (width - LEFT - RIGHT)) * xEnd) : last;
    pen.fillStyle = style.getPropertyValue(colour);
    pen.beginPath();
    pen.arc(xOf(marked[0]), yOf(marked[1]), 2.75, 0, 2 * Math.PI);
    pen.fill();
    if (isNumber(this.pointer)) setText(this.value, `${format(marked[1])} at ${short(marked[0])} ${this.xUnit}`);
  }
}

function nearest(points, x) {
  let best = points[0];
  for (const point of points) if (Math.abs(point[0] - x) < Math.abs(best[0] - x)) best = point;
  return best;
}

/** Round ticks that enclose `low`..`high`. */
function niceScale(low, high, wanted) {
  if (high - low < 1e-9) {
    const pad = Math.abs(high) * 0.1 || 1;
    low -= low === 0 ? 0 : pad;
    high += pad;
  }
  const raw = (high - low) / wanted;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((k) => k * power).find((candidate) => candidate >= raw);
  const first = Math.floor(low / step) * step;
  const ticks = [];
  for (let tick = first; tick < high + step; tick += step) ticks.push(tick);
  return { low: ticks[0], high: ticks.at(-1), ticks };
}

function short(value) {
  const size = Math.abs(value);
  if (size >= 1e6) return `${+(value / 1e6).toPrecision(3)}M`;
  if (size >= 1e3) return `${+(value / 1e3).toPrecision(3)}k`;
  return String(+value.toPrecision(3));
}

customElements.define("line-chart", LineChart);
