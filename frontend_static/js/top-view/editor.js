/**
 * Drawing and changing polygons: a state machine that knows the world alone, no canvas and no events.
 *
 * Tools: `move` looks around and selects; `region` and `no_go` add corners one by one. A corner under way or a
 * selected polygon's corner follows the pointer or the arrow keys.
 */
import { MOST_CORNERS, MOST_NO_GO, orders } from "../orders.js";
import { Observable } from "../observable.js";

const LEAST_CORNERS = 3;

export class PolygonEditor extends Observable {
  tool = "move";
  /** Corners of the polygon under way. */
  corners = [];
  /** `{kind, index}` of the selected polygon; null: none. */
  selected = null;
  /** Which corner of the selected polygon the keys move. */
  corner = 0;

  choose(tool) {
    this.tool = orders.possible ? tool : "move";
    this.corners = [];
    this.selected = null;
    this.changed("tool");
  }

  /** All polygons of the draft as `{kind, index, corners}`. */
  get polygons() {
    const { region, no_go: areas } = orders.draft;
    const all = areas.map((corners, index) => ({ kind: "no_go", index, corners }));
    return region ? [{ kind: "region", index: 0, corners: region }, ...all] : all;
  }

  get selectedCorners() {
    const { selected } = this;
    if (!selected) return null;
    const found = this.polygons.find(({ kind, index }) => kind === selected.kind && index === selected.index);
    return found?.corners ?? null;
  }

  /** Why another corner (or polygon) cannot be added; empty: it can. */
  get full() {
    if (this.corners.length >= MOST_CORNERS) return `A polygon has at most ${MOST_CORNERS} corners.`;
    if (this.tool === "no_go" && orders.draft.no_go.length >= MOST_NO_GO)
      return `There are at most ${MOST_NO_GO} no-go areas.`;
    return "";
  }

  add(point) {
    if (this.tool === "move" || this.full) return;
    this.corners = [...this.corners, rounded(point)];
    this.changed("corners");
  }

  /** Take the newest corner back. */
  takeBack() {
    this.corners = this.corners.slice(0, -1);
    this.changed("corners");
  }

  /** Finish the polygon under way: it becomes part of the draft, and selected. */
  close() {
    if (this.corners.length < LEAST_CORNERS) return;
    const target =
      this.tool === "region" ? { kind: "region", index: 0 } : { kind: "no_go", index: orders.draft.no_go.length };
    orders.setPolygon(target, this.corners);
    this.corners = [];
    this.tool = "move";
    this.selected = target;
    this.corner = 0;
    this.changed("tool", "corners");
  }

  /** Give up what is under way, or else the selection. */
  cancel() {
    if (this.corners.length > 0) this.corners = [];
    else if (this.tool !== "move") this.tool = "move";
    else this.selected = null;
    this.changed("tool", "corners");
  }

  select(target, corner = 0) {
    this.selected = target;
    this.corner = corner;
    this.tool = "move";
    this.changed("tool");
  }

  nextCorner(step) {
    const n = this.selectedCorners?.length;
    if (!n) return;
    this.corner = (this.corner + step + n) % n;
    this.changed("corners");
  }

  moveCorner(point) {
    const corners = this.selectedCorners;
    if (!corners || !orders.possible) return;
    orders.setPolygon(this.selected, corners.with(this.corner, rounded(point)));
    this.changed("corners");
  }

  /** Put a corner into the middle of the side after the current one. */
  split() {
    const corners = this.selectedCorners;
    if (!corners || corners.length >= MOST_CORNERS) return;
    const here = corners[this.corner];
    const next = corners[(this.corner + 1) % corners.length];
    const middle = rounded([(here[0] + next[0]) / 2, (here[1] + next[1]) / 2]);
    orders.setPolygon(this.selected, corners.toSpliced(this.corner + 1, 0, middle));
    this.corner += 1;
    this.changed("corners");
  }

  /** Remove the current corner; the whole polygon when three are left. */
  removeCorner() {
    const corners = this.selectedCorners;
    if (!corners) return;
    if (corners.length <= LEAST_CORNERS) {
      this.removeSelected();
      return;
    }
    orders.setPolygon(this.selected, corners.toSpliced(this.corner, 1));
    this.nextCorner(-1);
  }

  removeSelected() {
    if (!this.selected) return;
    orders.setPolygon(this.selected, null);
    this.selected = null;
    this.changed("tool", "corners");
  }
}

/** To the centimetre: nobody draws finer. */
const rounded = ([x, y]) => [Math.round(x * 100) / 100, Math.round(y * 100) / 100];

/** Whether `point` lies inside `corners` (even-odd rule). */
export function contains(corners, [x, y]) {
  let inside = false;
  for (let i = 0, j = corners.length - 1; i < corners.length; j = i++) {
    const [ax, ay] = corners[i];
    const [bx, by] = corners[j];
    if (ay > y !== by > y && x < ((bx - ax) * (y - ay)) / (by - ay) + ax) inside = !inside;
  }
  return inside;
}
