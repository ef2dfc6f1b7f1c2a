/** The map from above: what is known, where the robot was and goes, and the areas that the operator draws. */
import { Part } from "../observable.js";
import { element, fixed, isNumber, setText } from "../format.js";
import { orders } from "../orders.js";
import { store } from "../store.js";
import { themes } from "../theme.js";
import { MapCamera } from "../top-view/camera.js";
import { PolygonEditor, contains } from "../top-view/editor.js";
import { listenToGestures } from "../top-view/gestures.js";
import { keysOf } from "../top-view/keys.js";
import * as layers from "../top-view/layers.js";
import { penFor } from "../top-view/pen.js";
import { view } from "../view.js";

const NEAR_PX = 12;
const TOUCH_PX = 24;
const TOOLS = [
  ["move", "Look", "Drag to move, wheel or pinch to zoom, click an area to change it"],
  ["region", "Region", "Draw the region of interest: the robot explores it alone"],
  ["no_go", "No-go", "Draw an area that the robot must not enter"],
];
const HINTS = {
  move: "Arrows move, + and − zoom, 0 shows all",
  draw: "Click or Enter adds a corner; the first corner, a double click or C closes; Esc gives up",
  corner: "Drag corners, or arrows move one; N next, I insert, Del remove; Shift+Del removes the area",
};

class TopView extends Part {
  camera = new MapCamera();
  editor = new PolygonEditor();
  /** Where the next corner would come [m]; null while nothing is drawn. */
  cursor = null;

  connectedCallback() {
    this.canvas = element("canvas", {
      id: "top-view-canvas",
      tabindex: 0,
      role: "application",
      "aria-label": "Map from above",
      "aria-describedby": "top-view-hint",
    });
    this.tools = TOOLS.map(([tool, title, hint]) =>
      element(
        "button",
        { type: "button", id: `tool-${tool}`, title: hint, onclick: () => this.#choose(tool) },
        title,
      ),
    );
    this.hint = element("p", { id: "top-view-hint", class: "hint" });
    this.empty = element("p", { class: "empty" }, "The map appears here with the first frame.");
    const button = (label, text, act) =>
      element("button", { type: "button", "aria-label": label, title: label, onclick: act }, text);
    this.append(
      element("div", { class: "tools", role: "group", "aria-label": "Map tools" }, ...this.tools),
      element(
        "div",
        { class: "zoom", role: "group", "aria-label": "Zoom" },
        button("Zoom in", "+", () => this.zoom(1.4)),
        button("Zoom out", "−", () => this.zoom(1 / 1.4)),
        button("Show all", "⤢", () => this.fit()),
      ),
      document.createElement("map-legend"),
      this.canvas,
      this.empty,
      this.hint,
    );
    listenToGestures(this.canvas, this.#gestures());
    this.canvas.addEventListener("keydown", (event) => keysOf(this, event));
    this.canvas.addEventListener("dblclick", () => this.editor.close());
    this.canvas.addEventListener("focus", () => this.schedule());
    this.observer = new ResizeObserver(() => this.#resized());
    this.observer.observe(this.canvas);
    this.hear(themes, "theme", () => this.schedule());
    this.follow(view, ["map", "plan", "figures", "pointed"], () => this.#take());
    this.follow(orders, ["draft", "in force"], () => this.#drawTools());
    this.follow(this.editor, ["tool", "corners"], () => this.#drawTools());
  }

  disconnectedCallback() {
    super.disconnectedCallback();
    this.observer.disconnect();
  }

  fit() {
    this.chosen = false;
    this.#fitAll(true);
    this.schedule();
  }

  zoom(factor, at) {
    this.chosen = true;
    this.camera.zoom(factor, at);
    this.schedule();
  }

  pan(du, dv) {
    this.chosen = true;
    this.camera.pan(du, dv);
    this.schedule();
  }

  schedule() {
    if (this.scheduled) return;
    this.scheduled = true;
    requestAnimationFrame(() => {
      this.scheduled = false;
      this.#draw();
    });
  }

  #choose(tool) {
    this.editor.choose(tool);
    if (tool !== "move") this.chosen = true; // nothing moves under the pen
    this.cursor = tool === "move" ? null : [this.camera.x, this.camera.y];
    this.canvas.focus();
  }

  /** The whole map is shown until the operator has chosen a part of it. */
  #take() {
    this.empty.hidden = view.map !== null;
    if (store.mission?.id !== this.mission) {
      this.mission = store.mission?.id;
      this.chosen = false;
    }
    if (!this.chosen) this.#fitAll();
    this.schedule();
  }

  /**
   * The map, and the robot's way, which may lead out of what has been mapped so far. Unless it is asked for, nothing
   * moves while all of it is in sight.
   */
  #fitAll(asked = false) {
    const { facts } = view.map ?? {};
    if (!facts) return;
    const places = [facts.lower_m, facts.upper_m, ...facts.trajectory, ...view.trail];
    const least = (k) => places.reduce((low, place) => Math.min(low, place[k]), Infinity);
    const most = (k) => places.reduce((high, place) => Math.max(high, place[k]), -Infinity);
    const [lower, upper] = [[least(0), least(1)], [most(0), most(1)]];
    if (asked || !this.camera.fits(lower, upper)) this.camera.fit(lower, upper);
  }

  #resized() {
    [this.camera.width, this.camera.height] = [this.canvas.clientWidth, this.canvas.clientHeight];
    this.#take();
  }

  #drawTools() {
    const { tool } = this.editor;
    this.tools.forEach((button, k) => {
      button.setAttribute("aria-pressed", String(TOOLS[k][0] === tool));
      button.disabled = TOOLS[k][0] !== "move" && !orders.possible;
    });
    if (tool === "move") this.cursor = null;
    this.canvas.dataset.tool = tool;
    const full = tool === "move" ? "" : this.editor.full;
    setText(this.hint, full || HINTS[tool !== "move" ? "draw" : this.editor.selected ? "corner" : "move"]);
    this.schedule();
  }

  #gestures() {
    return {
      press: (at) => this.#takeHold(at),
      drag: (at) => this.editor.moveCorner(this.camera.toWorld(at)),
      release: () => {},
      pan: (du, dv) => this.pan(du, dv),
      zoom: (factor, at) => this.zoom(factor, at),
      tap: (at, event) => this.#tap(at, event.pointerType === "touch" ? TOUCH_PX : NEAR_PX),
      hover: (at) => this.#hover(at),
    };
  }

  /** Whether a corner of the selected polygon lies under the pointer: a drag then moves it. */
  #takeHold(at) {
    const corners = this.editor.selectedCorners;
    if (this.editor.tool !== "move" || !corners) return false;
    const place = this.#nearest(corners, at, TOUCH_PX / 1.5);
    if (place < 0) return false;
    this.editor.select(this.editor.selected, place);
    return true;
  }

  #tap(at, near) {
    const world = this.camera.toWorld(at);
    const { editor } = this;
    if (editor.tool !== "move") {
      const [first] = editor.corners;
      if (first && editor.corners.length >= 3 && this.#nearest([first], at, near) === 0) editor.close();
      else if (this.#nearest(editor.corners.slice(-1), at, 3) < 0) editor.add(world); // not a double click's second
      return;
    }
    const inside = editor.polygons.filter(({ corners }) => contains(corners, world));
    editor.select(inside.find(({ kind }) => kind === "no_go") ?? inside[0] ?? null);
    view.pointAt(this.#candidateAt(at, near));
  }

  #hover(at) {
    if (this.editor.tool !== "move") {
      this.cursor = at ? this.camera.toWorld(at) : null;
      this.schedule();
    } else if (at) {
      view.pointAt(this.#candidateAt(at, NEAR_PX));
    }
  }

  #candidateAt(at, near) {
    const candidates = view.plan?.candidates ?? [];
    const place = this.#nearest(candidates.map(({ x_m: x, y_m: y }) => [x, y]), at, near);
    return place < 0 ? null : place;
  }

  /** Place of the nearest of `points` [m] within `near` pixels; -1: none. */
  #nearest(points, [u, v], near) {
    let best = -1;
    let least = near;
    points.forEach((point, k) => {
      const [pu, pv] = this.camera.toScreen(point);
      const distance = Math.hypot(pu - u, pv - v);
      if (distance <= least) [best, least] = [k, distance];
    });
    return best;
  }

  #draw() {
    const pen = penFor(this.canvas, this.camera);
    if (!pen) return;
    const { map, plan, past } = view;
    const facts = map?.facts;
    layers.drawGround(pen);
    layers.drawMap(pen, map);
    if (facts) layers.drawSubspaces(pen, facts.subspaces);
    layers.drawAreas(pen, past ? orders.inForce : orders.draft, past || !orders.changedHere);
    if (facts) {
      layers.drawTrajectory(pen, facts.trajectory, view.trail);
      layers.drawPlan(pen, facts);
    }
    if (plan) layers.drawCandidates(pen, plan.candidates, view.pointedAt);
    if (facts) layers.drawRobot(pen, this.#robot(facts), facts.field_of_view_deg);
    if (orders.waiting && !past) layers.drawWaiting(pen, orders.waiting.view);
    if (!past) layers.drawEditor(pen, this.editor, this.cursor);
    layers.drawScale(pen);
    this.#describe(facts, plan);
  }

  /** In the present as fresh as the newest telemetry. */
  #robot(facts) {
    const { figures } = view;
    return figures && isNumber(figures.x_m) ? figures : facts.robot;
  }

  #describe(facts, plan) {
    const parts = ["Map from above"];
    if (facts) {
      const { x_m: x, y_m: y } = this.#robot(facts);
      parts.push(`robot at ${fixed(x, 1)}, ${fixed(y, 1)} metres`);
    }
    if (plan) parts.push(`${plan.n_selected} of ${plan.n_candidates} candidates chosen`);
    const areas = this.editor.polygons.length;
    if (areas) parts.push(`${areas} area${areas > 1 ? "s" : ""} drawn`);
    this.canvas.setAttribute("aria-label", parts.join(", "));
  }
}

customElements.define("top-view", TopView);
