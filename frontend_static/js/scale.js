/** Scales of charts: round ticks, short numbers. */

/** Round ticks that enclose `low`..`high`, about `wanted` of them. */
export function niceScale(low, high, wanted) {
  if (high - low < 1e-9) {
    const pad = Math.abs(high) * 0.1 || 1;
    low -= low === 0 ? 0 : pad;
    high += pad;
  }
  const step = niceStep(high - low, wanted);
  const first = Math.floor(low / step + 1e-9) * step;
  const ticks = [];
  for (let k = 0; ticks.length === 0 || ticks.at(-1) < high - 1e-9 * step; k++) ticks.push(first + k * step);
  return { low: ticks[0], high: ticks.at(-1), ticks };
}

/** Round ticks from 0 to at most `end`. */
export function ticksUpTo(end, wanted) {
  const step = niceStep(end, wanted);
  return Array.from({ length: Math.floor(end / step + 1e-9) + 1 }, (_, k) => k * step);
}

function niceStep(span, wanted) {
  const raw = span / wanted;
  const power = 10 ** Math.floor(Math.log10(raw));
  return [1, 2, 5, 10].map((k) => k * power).find((candidate) => candidate >= raw * (1 - 1e-9));
}

/** 1234567 -> "1.23M", 45678 -> "45.7k". */
export function short(value) {
  const size = Math.abs(value);
  if (size >= 1e6) return `${+(value / 1e6).toPrecision(3)}M`;
  if (size >= 1e3) return `${+(value / 1e3).toPrecision(3)}k`;
  return String(+value.toPrecision(3));
}
