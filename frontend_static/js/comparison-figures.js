/** Figures in which two missions are compared, and how their difference is told. */
import { clock, count, fixed, isNumber } from "./format.js";

const reported = (key, factor = 1) => ({ report }) => (isNumber(report?.[key]) ? report[key] * factor : null);
const live = (key) => ({ mission }) => mission.figures?.[key] ?? null;
const digits = (n) => (value) => fixed(value, n);

/** `better`: 1 where more is better, -1 where less is, 0 where neither. */
export const FIGURES = [
  figure("Mission time", "", live("time_s"), (v) => (isNumber(v) ? sign(v) + clock(Math.abs(v)) : "–"), -1),
  figure("Path", "m", live("path_length_m"), digits(1), -1),
  figure("Observed", "m³", live("observed_volume_m3"), digits(1), 1),
  figure("Missing", "m³", live("missing_volume_m3"), digits(2), -1),
  figure("Gaussians", "", live("n_gaussians"), (v) => (isNumber(v) ? sign(v) + count(Math.abs(v)) : "–"), 0),
  figure("Collisions", "", live("collisions"), digits(0), -1),
  figure("Completion ratio", "%", reported("completion_ratio_observable", 100), digits(1), 1),
  figure("Completion", "cm", reported("completion_cm_observable"), digits(2), -1),
  figure("Accuracy", "cm", reported("accuracy_cm"), digits(2), -1),
  figure("PSNR", "dB", reported("psnr_db"), digits(1), 1),
  figure("SSIM", "", reported("ssim"), digits(3), 1),
  figure("Depth error", "cm", reported("depth_l1_cm"), digits(2), -1),
  figure("Planning (median)", "ms", ({ report }) => scaled(report?.planning_s?.median, 1000), digits(0), -1),
];

function figure(title, unit, read, format, better) {
  return { title, unit, read, format, better };
}

const sign = (value) => (value < 0 ? "−" : "");
const scaled = (value, factor) => (isNumber(value) ? value * factor : null);

/** B less A of the figure with that title, in words, and whether that is `better`, `worse` or neither (empty). */
export function compared(title, [a, b]) {
  const { format, better } = FIGURES.find((figure) => figure.title === title);
  if (!isNumber(a) || !isNumber(b)) return { text: "–", verdict: "" };
  const change = b - a;
  const text = format(change);
  if (/^[−-]?[0:.]*$/.test(text)) return { text: "=", verdict: "" };
  const verdict = better === 0 ? "" : change * better > 0 ? "better" : "worse";
  const mark = { better: "▲ ", worse: "▼ " }[verdict] ?? "";
  return { text: `${mark}${change > 0 ? "+" : ""}${text}`, verdict };
}
