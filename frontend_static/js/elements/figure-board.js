/** The newest figures, each with its unit. */
import { clock, count, element, fixed, isNumber, setText } from "../format.js";
import { Part } from "../observable.js";
import { view } from "../view.js";

const FIGURES = [
  ["time", "Mission time", "", (f) => clock(f.time_s), "Time as the robot lives through it"],
  ["wall", "Wall time", "", (f) => clock(f.wall_s), "Time since the mission began, on this machine"],
  ["path", "Path", "m", (f) => fixed(f.path_length_m, 1), "Length of the driven path"],
  ["collisions", "Collisions", "", (f) => count(f.collisions), "Contacts with the true surface"],
  ["missing", "Missing", "m³", (f) => fixed(f.missing_volume_m3, 2), "Unseen volume beside free space"],
  ["observed", "Observed", "m³", (f) => fixed(f.observed_volume_m3, 1), "Volume seen free or occupied"],
  ["frames", "Frames", "", (f) => count(f.frame + 1), "Images taken"],
  ["gaussians", "Gaussians", "", (f) => count(f.n_gaussians), "Gaussians in the map"],
  ["psnr", "PSNR now", "dB", (f) => fixed(f.psnr_current_db, 1), "Newest image against the map"],
  ["keyframes", "Keyframes", "", (f) => count(f.n_keyframes), "Images kept for optimisation"],
  ["steps", "Steps", "", (f) => count(f.iterations), "Optimisation steps so far, one image each"],
  [
    "dropped",
    "Dropped",
    "",
    (f) => count(f.frames_dropped),
    "Images lost because mapper or planner was busy (real clock)",
  ],
  ["mapping", "Mapping", "ms/frame", (f) => milliseconds(f.mapping_s), "Wall time for the newest frame"],
  ["planning", "Planning", "ms", () => milliseconds(view.plan?.planning_s), "Wall time of the newest plan"],
];

class FigureBoard extends Part {
  connectedCallback() {
    this.values = {};
    const list = element("dl");
    for (const [name, title, unit, , hint] of FIGURES) {
      const value = element("span", { id: `figure-${name}` }, "–");
      const definition = element("dd", {}, value, element("span", { class: "unit" }, unit));
      const cell = element("div", { title: hint }, element("dt", {}, title), definition);
      this.values[name] = { value, cell };
      list.append(cell);
    }
    this.append(list);
    this.follow(view, ["figures", "plan", "mission"], () => this.#draw());
  }

  #draw() {
    const figures = view.figures ?? {};
    for (const [name, , , read] of FIGURES) setText(this.values[name].value, read(figures));
    this.values.collisions.cell.classList.toggle("alarm", figures.collisions > 0);
  }
}

function milliseconds(seconds) {
  return isNumber(seconds) ? fixed(seconds * 1000, 0) : "–";
}

customElements.define("figure-board", FigureBoard);
