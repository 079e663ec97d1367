// How a combination looks, as in the report: colour says culling, shape says structure.

import { svg } from "/parts/dom.js";

const COLOURS = 7;
export const SHAPES = ["circle", "square", "diamond", "up", "down", "cross"];
const IDLE = "none";

/** `structure × culling × rest` into the two things that a look is made of. */
export function split(label) {
  const [structure, culling = "", ...rest] = label.split(" × ");
  return { variant: [structure, ...rest].join(" × "), culling };
}

/** Looks for labels, in order of first appearance. */
export function looks(labels) {
  const variants = [];
  const cullings = [];
  for (const label of labels) {
    const { variant, culling } = split(label);
    if (!variants.includes(variant)) variants.push(variant);
    if (!cullings.includes(culling)) cullings.push(culling);
  }
  const busy = cullings.filter((c) => c !== IDLE);
  // Whoever culls nothing is grey.
  const colour = (culling) =>
    culling === IDLE ? "var(--muted)" : `var(--c${busy.indexOf(culling) % COLOURS})`;
  const shape = (variant) => SHAPES[variants.indexOf(variant) % SHAPES.length];
  return { variants, cullings, colour, shape };
}

const PATHS = {
  circle: (r) => `M${-r} 0a${r} ${r} 0 1 0 ${2 * r} 0a${r} ${r} 0 1 0 ${-2 * r} 0Z`,
  square: (r) => `M${-r} ${-r}H${r}V${r}H${-r}Z`,
  diamond: (r) => `M0 ${-r * 1.35}L${r * 1.35} 0L0 ${r * 1.35}L${-r * 1.35} 0Z`,
  up: (r) => `M0 ${-r * 1.25}L${r * 1.2} ${r}H${-r * 1.2}Z`,
  down: (r) => `M0 ${r * 1.25}L${r * 1.2} ${-r}H${-r * 1.2}Z`,
  cross: (r) =>
    `M${-r * 0.4} ${-r * 1.2}H${r * 0.4}V${-r * 0.4}H${r * 1.2}V${r * 0.4}H${r * 0.4}V${r * 1.2}H${-r * 0.4}V${r * 0.4}H${-r * 1.2}V${-r * 0.4}H${-r * 0.4}Z`,
};

/** A marker around 0, 0; `hollow` for what is not on the front. */
export function marker(shape, colour, { radius = 5, hollow = false } = {}) {
  const node = svg("path", { d: PATHS[shape](radius), class: "marker" });
  // Custom properties do not work in attributes of SVG, only in style.
  node.style.fill = hollow ? "var(--card)" : colour;
  node.style.stroke = colour;
  return node;
}

/** A marker by itself, for legends. */
export function markerIcon(shape, colour) {
  const icon = svg("svg", { width: 16, height: 16, viewBox: "-8 -8 16 16", "aria-hidden": "true" });
  icon.append(marker(shape, colour));
  return icon;
}
