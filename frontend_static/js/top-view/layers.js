/** The layers of the map from above, each one function of a pen and of what it shows. */
import { fixed, gain } from "../format.js";

const ROBOT_M = 0.3;
const REACH_M = 1.6;
const CANDIDATES = {
  selected: { shape: "disc", colour: "series-1", filled: true, size: 5 },
  crossing: { shape: "diamond", colour: "series-1", filled: true, size: 6 },
  below_threshold: { shape: "disc", colour: "map-faint", filled: false, size: 3.5 },
  unreachable: { shape: "cross", colour: "series-2", filled: false, size: 4 },
};
const SUBSPACES = {
  reconstructing: { colour: "series-2", dash: [6, 4] },
  unreconstructed: { colour: "series-4", dash: [2, 4] },
};

export function drawGround(pen) {
  const { context, camera } = pen;
  context.fillStyle = pen.colour("map-ground");
  context.fillRect(0, 0, camera.width, camera.height);
}

export function drawMap(pen, map) {
  if (map) pen.image(map.image, map.facts.lower_m, map.facts.upper_m);
}

export function drawSubspaces(pen, subspaces) {
  for (const { lower_m: [left, low], upper_m: [right, high], state } of subspaces) {
    const look = SUBSPACES[state];
    if (!look) continue;
    const inset = 2 / pen.camera.scale;
    const corners = [
      [left + inset, low + inset],
      [right - inset, low + inset],
      [right - inset, high - inset],
      [left + inset, high - inset],
    ];
    pen.line(corners, { ...look, width: 1.25, closed: true });
  }
}

/** `sent`: whether they are in force; what is only drawn here is dashed. */
export function drawAreas(pen, { region, no_go: areas }, sent) {
  const dash = sent ? [] : [7, 5];
  areas.forEach((corners, k) => {
    pen.hatch(corners, "no-go");
    pen.line(corners, { colour: "no-go", width: 2, dash, closed: true });
    pen.label(`No-go ${k + 1}`, middle(corners), { colour: "no-go-ink", shift: [0, 0] });
  });
  if (!region) return;
  pen.dimOutside(region);
  pen.line(region, { colour: "region", width: 2.5, dash, closed: true });
  const top = region.reduce((best, corner) => (corner[1] > best[1] ? corner : best));
  pen.label("Region of interest", top, { colour: "region-ink" });
}

export function drawTrajectory(pen, trajectory, trail = []) {
  pen.line([...trajectory, ...trail], { colour: "trajectory", width: 2.25 });
  if (trajectory.length === 0) return;
  pen.mark(trajectory[0], { shape: "square", size: 4, colour: "trajectory" });
}

export function drawPlan(pen, { global_tour: tour, local_path: path }) {
  pen.line(tour, { colour: "series-4", width: 1.75, dash: [3, 6] });
  pen.line(path, { colour: "series-1", width: 2.25, dash: [9, 5] });
}

/** The better ones over the others, the one that is pointed at over all. */
export function drawCandidates(pen, candidates, pointedAt) {
  const order = candidates.map((_, k) => k).sort((a, b) => candidates[a].total - candidates[b].total);
  for (const place of order) {
    const candidate = candidates[place];
    const at = [candidate.x_m, candidate.y_m];
    if (candidate.status === "selected") drawGaze(pen, candidate);
    pen.mark(at, CANDIDATES[candidate.status] ?? CANDIDATES.below_threshold);
  }
  const pointed = candidates[pointedAt];
  if (!pointed) return;
  pen.cone(pointed, 90, 2, "accent");
  const at = [pointed.x_m, pointed.y_m];
  pen.mark(at, { shape: "disc", size: 9, colour: "accent", filled: false });
  pen.mark(at, CANDIDATES[pointed.status] ?? CANDIDATES.below_threshold);
  pen.label(`total ${gain(pointed.total)}`, at, { shift: [0, -20] });
}

function drawGaze(pen, { x_m: x, y_m: y, yaw_deg: yaw }) {
  const angle = (yaw * Math.PI) / 180;
  const length = 13 / pen.camera.scale;
  pen.line([[x, y], [x + length * Math.cos(angle), y + length * Math.sin(angle)]], { colour: "series-1", width: 2 });
}

export function drawRobot(pen, pose, fieldOfViewDeg) {
  pen.cone(pose, fieldOfViewDeg, REACH_M, "trajectory");
  const { context, camera } = pen;
  const [u, v] = camera.toScreen([pose.x_m, pose.y_m]);
  const size = Math.max(8, ROBOT_M * camera.scale);
  context.save();
  context.translate(u, v);
  context.rotate((-pose.yaw_deg * Math.PI) / 180);
  context.beginPath();
  context.moveTo(size, 0);
  context.lineTo(-0.75 * size, 0.7 * size);
  context.lineTo(-0.4 * size, 0);
  context.lineTo(-0.75 * size, -0.7 * size);
  context.closePath();
  context.fillStyle = pen.colour("robot");
  context.fill();
  context.lineWidth = 2;
  context.strokeStyle = pen.colour("map-rim");
  context.stroke();
  context.restore();
}

/** The view that waits for the operator's word. */
export function drawWaiting(pen, { x_m: x, y_m: y, yaw_deg: yaw }) {
  pen.cone({ x_m: x, y_m: y, yaw_deg: yaw }, 90, 2.2, "paused");
  pen.mark([x, y], { shape: "disc", size: 11, colour: "paused", filled: false });
  pen.label("Approve this view?", [x, y], { colour: "warn-ink", shift: [0, -24] });
}

/** What is being drawn or changed: corners to take hold of, and the cross that the keys move. */
export function drawEditor(pen, editor, cursor) {
  const colour = editor.tool === "no_go" ? "no-go" : "region";
  if (editor.tool !== "move") {
    const points = cursor ? [...editor.corners, cursor] : editor.corners;
    pen.line(points, { colour, width: 2, dash: [5, 5] });
    editor.corners.forEach((corner, k) => pen.mark(corner, { shape: "disc", size: k ? 4 : 6, colour }));
    if (cursor) drawCursor(pen, cursor);
  }
  editor.selectedCorners?.forEach((corner, k) => {
    const current = k === editor.corner;
    pen.mark(corner, { shape: "square", size: current ? 6 : 4.5, colour: current ? "accent" : "map-plate" });
  });
}

function drawCursor(pen, cursor) {
  const { context } = pen;
  const [u, v] = pen.camera.toScreen(cursor);
  for (const [colour, width] of [["map-rim", 3.5], ["accent", 1.5]]) {
    context.beginPath();
    context.moveTo(u - 10, v);
    context.lineTo(u + 10, v);
    context.moveTo(u, v - 10);
    context.lineTo(u, v + 10);
    context.strokeStyle = pen.colour(colour);
    context.lineWidth = width;
    context.stroke();
  }
}

/** A bar of a round length, lower left. */
export function drawScale(pen) {
  const { context, camera } = pen;
  const metres = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50].find((length) => length * camera.scale > 50) ?? 100;
  const [left, low] = [12, camera.height - 12];
  context.strokeStyle = pen.colour("map-rim");
  context.lineWidth = 5;
  context.beginPath();
  context.moveTo(left, low);
  context.lineTo(left + metres * camera.scale, low);
  context.stroke();
  context.strokeStyle = pen.colour("ink");
  context.lineWidth = 2;
  context.stroke();
  pen.label(`${fixed(metres, metres < 1 ? 1 : 0)} m`, camera.toWorld([left + 20, low]), { shift: [0, -12] });
}

function middle(corners) {
  const n = corners.length;
  return [corners.reduce((sum, [x]) => sum + x, 0) / n, corners.reduce((sum, [, y]) => sum + y, 0) / n];
}
