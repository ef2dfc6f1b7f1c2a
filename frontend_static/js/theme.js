/** Light, dark, or as the system says; kept in this browser. Canvases redraw on `theme`. */
const KEY = "hgs-theme";
const CHOICES = ["system", "light", "dark"];
const system = matchMedia("(prefers-color-scheme: dark)");

export const themes = new EventTarget();

export function chosenTheme() {
  const kept = localStorage.getItem(KEY);
  return CHOICES.includes(kept) ? kept : "system";
}

export function nextTheme() {
  const next = CHOICES[(CHOICES.indexOf(chosenTheme()) + 1) % CHOICES.length];
  localStorage.setItem(KEY, next);
  applyTheme();
}

/** Sets `data-theme` on the root, which the style sheet reads. */
export function applyTheme() {
  const choice = chosenTheme();
  const dark = choice === "dark" || (choice === "system" && system.matches);
  document.documentElement.dataset.theme = dark ? "dark" : "light";
  themes.dispatchEvent(new Event("theme"));
}

system.addEventListener("change", applyTheme);
applyTheme();
