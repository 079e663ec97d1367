// Ratios with intervals on a common logarithmic axis, one small drawing a row, so that a
// table of thousands of pairs is a forest plot too.

import { svg } from "/parts/dom.js";
import { tick } from "/parts/format.js";
import { axis } from "/parts/scales.js";

const WIDTH = 220;
const ROW = 20;
// Beyond this factor an arrow says enough; a single outlier must not squeeze the rest.
const MOST = 64;

/** An axis for all ratios, symmetric around 1: `axis()` for the head, `bar(ratio)` a row. */
export function forest(ratios) {
  let reach = 1.05;
  for (const r of ratios) {
    if (!r) continue;
    for (const v of [r.low ?? r.value, r.high ?? r.value])
      if (v > 0 && Number.isFinite(v)) reach = Math.max(reach, v, 1 / v);
  }
  reach = Math.min(reach, MOST);
  const scale = axis([1 / reach, reach], [8, WIDTH - 8], { log: true, pad: 0.05 });
  // What lies beyond the axis stays at its edge.
  const at = (v) => Math.max(2, Math.min(WIDTH - 2, scale.at(v)));
  const one = scale.at(1);
  const ticks = [...new Set([...ticksFor(reach), 1])].sort((a, b) => a - b);

  return {
    axis() {
      const node = svg("svg", {
        width: WIDTH,
        height: 26,
        class: "forest",
        role: "img",
        "aria-label": `Ratios from ${tick(scale.low)} to ${tick(scale.high)}, logarithmic`,
      });
      for (const t of ticks)
        node.append(
          svg("line", { x1: scale.at(t), x2: scale.at(t), y1: 19, y2: 26, class: "tick" }),
          svg("text", { x: scale.at(t), y: 13, "text-anchor": "middle" }, tick(t)),
        );
      return node;
    },
    bar(ratio, change) {
      const node = svg(
        "svg",
        { width: WIDTH, height: ROW, class: `forest ${change}`, "aria-hidden": "true" },
        svg("line", { x1: one, x2: one, y1: 0, y2: ROW, class: "one" }),
      );
      if (!ratio || !(ratio.value > 0)) return node;
      const [low, high] = [at(ratio.low ?? ratio.value), at(ratio.high ?? ratio.value)];
      node.append(svg("line", { x1: low, x2: high, y1: ROW / 2, y2: ROW / 2, class: "interval" }));
      for (const x of [low, high])
        node.append(svg("line", { x1: x, x2: x, y1: ROW / 2 - 3, y2: ROW / 2 + 3, class: "interval" }));
      node.append(
        svg("rect", { x: at(ratio.value) - 3.5, y: ROW / 2 - 3.5, width: 7, height: 7, class: "value" }),
      );
      return node;
    },
  };
}

/** Ratios that read well, as many as fit. */
function ticksFor(reach) {
  const sets = [
    [0.95, 1.05],
    [0.9, 1.1],
    [0.8, 1.25],
    [0.67, 1.5],
    [0.5, 2],
    [0.25, 0.5, 2, 4],
    [0.1, 0.3, 3, 10],
    [0.02, 0.1, 10, 50],
  ];
  return [...sets].reverse().find((s) => Math.max(...s) <= reach * 1.05) || sets[0];
}
