/** The keyboard on the map from above: everything that the mouse can do. */
import { setText } from "../format.js";

const STEP_PX = 16;
const FINE = 0.25;
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

/** Take a key event of `map`, a `<top-view>`; keys that mean nothing here go on to the page. */
export function keysOf(map, event) {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const { editor } = map;
  const arrow = ARROWS[event.key];
  let act = null;
  if (arrow) act = () => move(map, arrow, event.shiftKey ? FINE : 1);
  else if (editor.tool !== "move") act = drawing(map, event.key);
  else if (editor.selected) act = changing(editor, event);
  act ??= looking(map, event.key);
  if (!act) return;
  event.preventDefault();
  event.stopPropagation();
  act();
}

function looking(map, key) {
  return {
    "+": () => map.zoom(1.25),
    "=": () => map.zoom(1.25),
    "-": () => map.zoom(1 / 1.25),
    0: () => map.fit(),
  }[key];
}

function drawing(map, key) {
  const { editor } = map;
  const add = () => {
    map.cursor ??= [map.camera.x, map.camera.y];
    editor.add(map.cursor);
    say(`Corner ${editor.corners.length} at ${spoken(map.cursor)}`);
  };
  return {
    Enter: add,
    " ": add,
    c: () => editor.close(),
    C: () => editor.close(),
    Backspace: () => editor.takeBack(),
    Escape: () => editor.cancel(),
  }[key];
}

function changing(editor, { key, shiftKey }) {
  return {
    n: () => editor.nextCorner(1),
    N: () => editor.nextCorner(-1),
    i: () => editor.split(),
    Delete: () => (shiftKey ? editor.removeSelected() : editor.removeCorner()),
    Escape: () => editor.cancel(),
  }[key];
}

/** Arrows move what is being drawn, or the corner that is held, or else the map. Shift: a quarter of a step. */
function move(map, [right, down], share) {
  const { camera, editor } = map;
  const step = (STEP_PX * share) / camera.scale;
  const shifted = ([x, y]) => [x + right * step, y - down * step];
  if (editor.tool !== "move") {
    map.cursor = shifted(map.cursor ?? [camera.x, camera.y]);
    keepInSight(map);
    map.schedule();
  } else if (editor.selectedCorners) {
    editor.moveCorner(shifted(editor.selectedCorners[editor.corner]));
    say(`Corner ${editor.corner + 1} at ${spoken(editor.selectedCorners[editor.corner])}`);
  } else {
    map.pan(-right * 3 * STEP_PX * share, -down * 3 * STEP_PX * share);
  }
}

function keepInSight(map) {
  const { camera } = map;
  const [u, v] = camera.toScreen(map.cursor);
  const out = (place, size) => Math.min(0, place - 20) + Math.max(0, place - size + 20);
  map.pan(-out(u, camera.width), -out(v, camera.height));
}

const spoken = ([x, y]) => `${x.toFixed(1)}, ${y.toFixed(1)} metres`;

const say = (text) => setText(document.getElementById("announcer"), text);
