// One tooltip for charts: it follows the pointer or stands beside what has the focus.

import { h, set } from "/parts/dom.js";

const GAP = 14;
let node = null;

/** Shows nodes beside a point of the window; a pending call is replaced. */
export function showTip(x, y, ...content) {
  node ??= document.body.appendChild(h("div", { class: "tip", role: "tooltip" }));
  set(node, content);
  node.hidden = false;
  const { width, height } = node.getBoundingClientRect();
  const right = x + GAP + width > innerWidth ? x - GAP - width : x + GAP;
  const below = y + GAP + height > innerHeight ? y - GAP - height : y + GAP;
  node.style.left = `${Math.max(4, right)}px`;
  node.style.top = `${Math.max(4, below)}px`;
}

export function hideTip() {
  if (node) node.hidden = true;
}

/** Name and value lines of a tooltip. */
export const tipLine = (name, value) =>
  h("div", { class: "tip-line" }, h("span", null, name), h("b", null, value));
