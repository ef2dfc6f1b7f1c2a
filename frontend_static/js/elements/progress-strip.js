/** How far the mission is: time and path against their limits, what is still missing, an estimate of the rest. */
import { clock, element, fixed, isNumber, setText } from "../format.js";
import { timeLeft } from "../estimate.js";
import { Part } from "../observable.js";
import { orders } from "../orders.js";
import { store } from "../store.js";
import { view } from "../view.js";

const ESTIMATE_HINT =
  "An estimate from how fast the missing volume falls; what lies behind the next door may change it. " +
  "The mission ends at its time limit or path budget at the latest.";

class ProgressStrip extends Part {
  connectedCallback() {
    this.time = meter("Time", "progress-time");
    this.path = meter("Path", "progress-path");
    this.missing = element("span", { id: "progress-missing" });
    this.estimate = element("span", { id: "progress-estimate", title: ESTIMATE_HINT });
    this.append(
      this.time.group,
      this.path.group,
      element("span", { class: "group" }, element("b", {}, "Missing"), this.missing),
      element("span", { class: "group rest" }, element("b", {}, "Left"), this.estimate),
    );
    this.follow(view, ["figures", "mission"], () => this.#draw());
    this.follow(orders, ["in force"], () => this.#draw());
  }

  #draw() {
    const { mission } = store;
    const figures = view.figures ?? {};
    const limit = mission?.time_limit_s;
    draw(this.time, figures.time_s, limit, (s) => clock(s), "no limit");
    draw(this.path, figures.path_length_m, orders.inForce.max_path_m, (m) => `${fixed(m, 1)} m`, "no budget");
    setText(this.missing, isNumber(figures.missing_volume_m3) ? `${fixed(figures.missing_volume_m3, 2)} m³` : "–");
    setText(this.estimate, this.#rest());
  }

  #rest() {
    if (view.past) return "looking at the past";
    if (!store.active || !store.figures) return "–";
    const range = timeLeft(store.series.time_s, store.series.missing_volume_m3);
    if (!range) return "no estimate yet: no steady trend";
    const limit = Math.max(0, (store.mission.time_limit_s ?? Infinity) - store.figures.time_s);
    if (range[0] > limit) return `${clock(limit)} to the time limit, before all is seen (estimate)`;
    const [least, most] = range.map((seconds) => Math.min(seconds, limit));
    if (most < 20) return "nearly done (estimate)";
    const [from, to] = [roughly(least), roughly(most)];
    return from === to ? `about ${to} (estimate)` : `${from} to ${to} (estimate)`;
  }
}

function meter(title, id) {
  const bar = element("i");
  const track = element("span", {
    class: "track",
    role: "progressbar",
    "aria-label": title,
    "aria-valuemin": 0,
    "aria-valuemax": 100,
  });
  track.append(bar);
  const text = element("span", { id });
  return { group: element("span", { class: "group" }, element("b", {}, title), text, track), bar, track, text };
}

function draw({ bar, track, text }, value, limit, format, without) {
  const known = isNumber(value) && isNumber(limit) && limit > 0;
  const share = known ? Math.min(100, (value / limit) * 100) : 0;
  bar.style.width = `${share}%`;
  track.hidden = !known;
  if (known) track.setAttribute("aria-valuenow", Math.round(share));
  if (!isNumber(value)) setText(text, "–");
  else if (known) setText(text, `${format(value)} of ${format(limit)}, ${format(Math.max(0, limit - value))} left`);
  else setText(text, `${format(value)}, ${without}`);
}

/** As exact as an estimate deserves: 40 s, 3 min, 1.5 h. */
function roughly(seconds) {
  if (seconds < 55) return `${Math.max(10, Math.round(seconds / 10) * 10)} s`;
  if (seconds < 3300) return `${Math.round(seconds / 60)} min`;
  return `${(seconds / 3600).toFixed(1)} h`;
}

customElements.define("progress-strip", ProgressStrip);
