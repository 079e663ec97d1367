// The colours of triangles and nodes, apart from those of the page. They keep apart for
// all common kinds of colour blindness (after Okabe and Ito), and what matters most,
// lost triangles, is also said by shape: outlines and rings through walls.

import { DRAWN, FIRST_CULLED, HIDDEN, NOT_REACHED, WENT_ON } from "./formats.js";

export const STATE_COLOURS = ["#9aa3ab", "#e69f00", "#009e73", "#d6003b"];
export const STATE_NAMES = ["Not submitted", "Over-submission", "Submitted, seen", "Lost"];
export const STATE_HELP = [
  "What the method left out, and what nobody could see either",
  "Submitted although no pixel shows it",
  "Drawn and needed",
  "False culls: the camera sees them, and the method left them out",
];

const DECISIONS = { [NOT_REACHED]: "#8d949b", [DRAWN]: "#009e73", [WENT_ON]: "#7c8794", [HIDDEN]: "#b5651d" };
const TESTS = ["#56b4e9", "#cc79a7", "#0072b2", "#d55e00", "#8b6bd6", "#b8a000", "#a0522d", "#4a5a9c"];

export const decisionColour = (byte) =>
  byte >= FIRST_CULLED ? TESTS[(byte - FIRST_CULLED) % TESTS.length] : (DECISIONS[byte] ?? "#888888");

export function decisionName(byte, tests) {
  if (byte === NOT_REACHED) return "Not reached";
  if (byte === DRAWN) return "Drawn";
  if (byte === WENT_ON) return "Went on to children";
  if (byte === HIDDEN) return "Hidden: the walk found nothing of it to see";
  return `Culled: ${tests[byte - FIRST_CULLED] ?? `test ${byte - FIRST_CULLED}`}`;
}

/** `#rrggbb` as three numbers from 0 to 1. */
export const rgb = (hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16) / 255);

const context = () => {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 1;
  return canvas.getContext("2d", { willReadFrequently: true });
};

/** Colours of the page as numbers: a probe resolves variables, a pixel any notation. */
export function pageColours(root) {
  const probe = document.createElement("span");
  probe.hidden = true;
  root.append(probe);
  const paint = context();
  const read = (name) => {
    probe.style.color = `var(--cmv-${name})`;
    paint.clearRect(0, 0, 1, 1);
    paint.fillStyle = getComputedStyle(probe).color;
    paint.fillRect(0, 0, 1, 1);
    const [r, g, b] = paint.getImageData(0, 0, 1, 1).data;
    return [r / 255, g / 255, b / 255];
  };
  const colours = Object.fromEntries(["paper", "ink", "muted", "line", "accent"].map((name) => [name, read(name)]));
  probe.remove();
  return colours;
}

export const mix = (a, b, t) => a.map((x, k) => x + (b[k] - x) * t);
