/** Pointer gestures on the map: one finger or the mouse drags, two pinch, the wheel zooms, a tap is a click. */

const TAP_PX = 6;
const WHEEL = 0.0016;

/**
 * `actions`: `press(at)` says whether a drag from there is its own (a corner is held); `drag(at)`, `release()`
 * follow it. Otherwise `pan(du, dv)` and `zoom(factor, at)`; `tap(at, event)`, `hover(at)` (null: has left).
 * Positions are pixels of the canvas.
 */
export function listenToGestures(canvas, actions) {
  const pointers = new Map();
  let held = false;
  let moved = 0;

  const at = (event) => {
    const box = canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };

  canvas.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    canvas.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, at(event));
    if (pointers.size === 1) {
      moved = 0;
      held = actions.press(at(event));
    } else if (held) {
      held = false;
      actions.release();
    }
  });

  canvas.addEventListener("pointermove", (event) => {
    const before = pointers.get(event.pointerId);
    const now = at(event);
    if (!before) {
      actions.hover(now);
      return;
    }
    moved += Math.hypot(now[0] - before[0], now[1] - before[1]);
    if (pointers.size === 2) pinch(event.pointerId, now);
    else if (moved > TAP_PX && held) actions.drag(now);
    else if (moved > TAP_PX) actions.pan(now[0] - before[0], now[1] - before[1]);
    pointers.set(event.pointerId, now);
  });

  function pinch(id, now) {
    const [other] = [...pointers].filter(([key]) => key !== id).map(([, place]) => place);
    const before = pointers.get(id);
    const spread = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1]) || 1;
    const middle = [(now[0] + other[0]) / 2, (now[1] + other[1]) / 2];
    actions.pan((now[0] - before[0]) / 2, (now[1] - before[1]) / 2);
    actions.zoom(spread(now, other) / spread(before, other), middle);
    moved = Infinity;
  }

  const lift = (event) => {
    if (!pointers.delete(event.pointerId)) return;
    if (pointers.size > 0) return;
    if (held) actions.release();
    if (moved <= TAP_PX && event.type === "pointerup") actions.tap(at(event), event);
    held = false;
  };
  canvas.addEventListener("pointerup", lift);
  canvas.addEventListener("pointercancel", lift);
  canvas.addEventListener("pointerleave", () => actions.hover(null));
  canvas.addEventListener(
    "wheel",
    (event) => {
      event.preventDefault();
      actions.zoom(Math.exp(-event.deltaY * WHEEL), at(event));
    },
    { passive: false },
  );
}
