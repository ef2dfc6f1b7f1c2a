/** What is charted of a mission, with units. */
import { count, fixed, isNumber } from "./format.js";

/** `read` makes the values of a mission's series (lists by column). */
export const CHARTS = [
  {
    field: "coverage",
    title: "Seen of found",
    colour: "--series-3",
    format: (v) => `${fixed(v, 1)} %`,
    read: coverage,
  },
  column("missing_volume_m3", "Missing", "--series-2", (v) => `${fixed(v, 2)} m³`),
  column("psnr_current_db", "PSNR now", "--series-1", (v) => `${fixed(v, 1)} dB`),
  column("n_gaussians", "Gaussians", "--series-4", (v) => count(v)),
  { field: "planning_s", title: "Planning", colour: "--series-5", format: (v) => `${fixed(v, 0)} ms` },
];

function column(field, title, colour, format) {
  return { field, title, colour, format, read: (series) => series[field] };
}

/**
 * Observed volume as a share of all that was found so far, observed or missing [%]: rooms that nothing has been seen of are
 * in neither. None before the first plan, which looks for what is missing.
 */
export function coverage({ observed_volume_m3: observed, missing_volume_m3: missing }) {
  let looked = false;
  return observed.map((volume, k) => {
    looked ||= missing[k] > 0;
    return looked && isNumber(volume) && isNumber(missing[k]) ? (100 * volume) / (volume + missing[k]) : null;
  });
}

/** Planning times [ms] over mission time, or over the path that had been driven then. */
export function planningOver(axis, series, plans) {
  const ys = plans.planning_s.map((seconds) => (isNumber(seconds) ? 1000 * seconds : null));
  if (axis === "time_s") return { xs: plans.time_s, ys };
  let k = 0;
  const xs = plans.time_s.map((time) => {
    while (k < series.time_s.length - 1 && series.time_s[k + 1] <= time) k += 1;
    return series[axis][k];
  });
  return { xs, ys };
}
