/** Numbers and words as operators read them. */

const NONE = "–";

export const isNumber = (value) => typeof value === "number" && Number.isFinite(value);

export function fixed(value, digits) {
  return isNumber(value) ? value.toFixed(digits) : NONE;
}

/** 1234567 -> "1.23 M", 45678 -> "45.7 k". */
export function count(value) {
  if (!isNumber(value)) return NONE;
  if (value >= 1e6) return `${(value / 1e6).toFixed(2)} M`;
  if (value >= 1e4) return `${(value / 1e3).toFixed(1)} k`;
  return String(Math.round(value));
}

/** 75 -> "1:15", 3700 -> "1:01:40". */
export function clock(seconds) {
  if (!isNumber(seconds)) return NONE;
  const whole = Math.floor(seconds);
  const hours = Math.floor(whole / 3600);
  const minutes = Math.floor((whole % 3600) / 60);
  const rest = String(whole % 60).padStart(2, "0");
  return hours ? `${hours}:${String(minutes).padStart(2, "0")}:${rest}` : `${minutes}:${rest}`;
}

export function bytes(value) {
  if (value >= 1e6) return `${(value / 1e6).toFixed(1)} MB`;
  if (value >= 1e3) return `${(value / 1e3).toFixed(1)} kB`;
  return `${value} B`;
}

/** Gains: two decimals where they matter, one where they do not. */
export function gain(value) {
  if (!isNumber(value)) return NONE;
  if (value !== 0 && Math.abs(value) < 0.005) return "<0.01";
  return value.toFixed(Math.abs(value) < 9.995 ? 2 : 1);
}

/** An element with attributes and children; strings become text. */
export function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (value === true) made.setAttribute(name, "");
    else if (value !== false && value !== null && value !== undefined) made.setAttribute(name, value);
  }
  made.append(...children);
  return made;
}

/** Set text only when it differs, so that selections and screen readers are left alone. */
export function setText(node, text) {
  if (node.textContent !== text) node.textContent = text;
}
