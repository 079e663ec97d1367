// Light and dark: the system's choice until the user makes one, which is remembered.
// Canvases ask here for the colours of the style sheet, and are told when these change.

const KEY = "cullmark.theme";
const CHOICES = ["auto", "light", "dark"];
const LABELS = { auto: "Theme: as the system", light: "Theme: light", dark: "Theme: dark" };
const ICONS = { auto: "◐", light: "☀", dark: "☾" };
const system = matchMedia("(prefers-color-scheme: dark)");
const listeners = new Set();

let choice = "auto";

function remembered() {
  // A theme in the address is for this view alone, such as a picture in a document.
  const asked = new URLSearchParams(location.search).get("theme");
  if (CHOICES.includes(asked)) return asked;
  try {
    return localStorage.getItem(KEY) || "auto";
  } catch {
    return "auto";
  }
}

export const isDark = () => (choice === "auto" ? system.matches : choice === "dark");

function apply() {
  document.documentElement.dataset.theme = isDark() ? "dark" : "light";
  for (const f of listeners) f();
}

/** Call before anything is drawn. */
export function startTheme() {
  choice = remembered();
  apply();
  system.addEventListener("change", apply);
}

/** Calls `f` when the theme changes. */
export function watchTheme(f, signal) {
  listeners.add(f);
  signal?.addEventListener("abort", () => listeners.delete(f));
}

/** The value of a custom property, for canvases: `ink("--muted")`. */
export const ink = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

/** A button that steps through the three choices. */
export function themeControl(button) {
  const tell = () => {
    button.textContent = ICONS[choice];
    button.title = LABELS[choice];
    button.setAttribute("aria-label", `${LABELS[choice]}. Change the theme`);
  };
  button.addEventListener("click", () => {
    choice = CHOICES[(CHOICES.indexOf(choice) + 1) % CHOICES.length];
    try {
      localStorage.setItem(KEY, choice);
    } catch {
      // Holds until the page is left.
    }
    apply();
    tell();
  });
  tell();
}
