/**
 * How long a mission may still take, from how what is missing goes down. An estimate: nobody knows what lies behind
 * the next door, so it is a range, and none where the trend says nothing.
 */
import { isNumber } from "./format.js";

const WINDOW_SHARE = 0.4;
const LEAST_POINTS = 8;
const LEAST_FALL = 0.05;
const DONE_SHARE = 0.05;

/**
 * `[least, most]` in seconds of mission time until what is missing has fallen to a twentieth of its peak, or null.
 * The least goes on falling as fast as over the last part of the mission, the most ever slower, by the same share
 * in the same time; missions mostly end between the two.
 */
export function timeLeft(times, missing) {
  const points = times.map((time, k) => [time, missing[k]]).filter(([t, m]) => isNumber(t) && isNumber(m));
  const last = points.at(-1);
  if (!last) return null;
  const peak = points.reduce((most, [, m]) => Math.max(most, m), 0);
  const done = DONE_SHARE * peak;
  if (last[1] <= done) return [0, 0];
  const recent = points.filter(([time]) => time >= last[0] * (1 - WINDOW_SHARE));
  if (recent.length < LEAST_POINTS) return null;
  const span = last[0] - recent[0][0];
  const slope = slopeOf(recent);
  if (-slope * span < LEAST_FALL * peak) return null;
  const rate = -slopeOf(recent.map(([time, m]) => [time, Math.log(Math.max(m, done / 10))]));
  const linear = (last[1] - done) / -slope;
  const slowing = rate > 0 ? Math.log(last[1] / done) / rate : linear;
  return [Math.min(linear, slowing), Math.max(linear, slowing)];
}

/** Of the straight line with the least squared error. */
function slopeOf(points) {
  const n = points.length;
  const meanX = points.reduce((sum, [x]) => sum + x, 0) / n;
  const meanY = points.reduce((sum, [, y]) => sum + y, 0) / n;
  const across = points.reduce((sum, [x, y]) => sum + (x - meanX) * (y - meanY), 0);
  const along = points.reduce((sum, [x]) => sum + (x - meanX) ** 2, 0);
  return along > 0 ? across / along : 0;
}
