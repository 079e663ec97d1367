// A Pareto front of one scene as SVG: points with intervals, the front as a stair,
// what is dominated pale. Points are reached with the arrow keys.

import { h, set, svg } from "/parts/dom.js";
import { interval, tick } from "/parts/format.js";
import { marker } from "/parts/looks.js";
import { axis, extent } from "/parts/scales.js";
import { hideTip, showTip, tipLine } from "/parts/tooltip.js";

const HEIGHT = 380;
const MARGIN = { left: 66, right: 18, top: 14, bottom: 48 };
const STANDING = {
  front: "on the front",
  within_noise: "behind the front by less than the intervals can tell",
  dominated: "dominated",
};

/**
 * `look(point)` gives `{shape, colour}`; `x`, `y` are `{name, unit}`; logs say which
 * axes are logarithmic; `onOpen(point, event)` opens its run.
 */
export function scatter({ title, points, x, y, log, look, onOpen, width = 560 }) {
  const usable = points.filter((p) => (!log.x || p.x.value > 0) && (!log.y || p.y.value > 0));
  // Whiskers are inside the axes, too.
  const ends = (key) =>
    extent(
      usable.flatMap((p) => [p[key].low ?? p[key].value, p[key].value, p[key].high ?? p[key].value]),
      log[key],
    );
  const right = width - MARGIN.right;
  const bottom = HEIGHT - MARGIN.bottom;
  const xs = axis(ends("x"), [MARGIN.left, right], { log: log.x, zero: true });
  const ys = axis(ends("y"), [bottom, MARGIN.top], { log: log.y, zero: true });
  const root = svg("svg", {
    viewBox: `0 0 ${width} ${HEIGHT}`,
    width: "100%",
    class: "scatter",
    role: "group",
    "aria-label": `${title}: ${usable.length} points. Arrow keys move, Enter opens the run.`,
  });
  root.append(grid(xs, ys, right, bottom, x, y));
  const ordered = [...usable].sort((a, b) => a.x.value - b.x.value || a.y.value - b.y.value);
  root.append(
    stair(
      ordered.filter((p) => p.standing === "front"),
      xs,
      ys,
      right,
    ),
  );
  // The front is drawn last, so that nothing lies over it.
  const rank = { dominated: 0, within_noise: 1, front: 2 };
  const nodes = new Map();
  for (const p of [...ordered].sort((a, b) => rank[a.standing] - rank[b.standing])) {
    const node = pointNode(p, xs, ys, look(p));
    nodes.set(p, node);
    root.append(node);
  }

  let current = -1;
  // What the tooltip says.
  const describe = (p) => [
    h("div", null, h("code", null, p.label)),
    tipLine(x.name, `${interval(p.x)} ${x.unit || ""}`),
    tipLine(y.name, `${interval(p.y)} ${y.unit || ""}`),
    h("div", { class: "tip-muted" }, STANDING[p.standing] || p.standing),
    p.by?.length > 0 &&
      h(
        "div",
        { class: "tip-muted" },
        `by ${p.by.slice(0, 3).join(", ")}${p.by.length > 3 ? ` and ${p.by.length - 3} more` : ""}`,
      ),
  ];
  // Beside the point, whether pointer or keys came to it.
  const tip = (p) => {
    const edge = nodes.get(p).querySelector(".marker").getBoundingClientRect();
    showTip(edge.left + edge.width / 2, edge.top + edge.height / 2, describe(p));
  };

  /** Roving focus: one stop for Tab, arrows go from left to right. */
  function focusAt(i) {
    if (ordered.length === 0) return;
    current = Math.max(0, Math.min(ordered.length - 1, i));
    for (const n of nodes.values()) n.setAttribute("tabindex", -1);
    const node = nodes.get(ordered[current]);
    node.setAttribute("tabindex", 0);
    node.focus();
  }
  for (const [p, node] of nodes) {
    node.addEventListener("pointerenter", () => tip(p));
    node.addEventListener("pointerleave", hideTip);
    node.addEventListener("focus", () => {
      current = ordered.indexOf(p);
      tip(p);
    });
    node.addEventListener("blur", hideTip);
    node.addEventListener("click", (event) => onOpen(p, event));
  }
  if (ordered.length) nodes.get(ordered[0]).setAttribute("tabindex", 0);
  root.addEventListener("keydown", (event) => {
    const to = {
      ArrowRight: current + 1,
      ArrowUp: current + 1,
      ArrowLeft: current - 1,
      ArrowDown: current - 1,
      Home: 0,
      End: ordered.length - 1,
    }[event.key];
    if (to !== undefined) {
      event.preventDefault();
      focusAt(to);
    } else if (event.key === "Enter" && current >= 0) onOpen(ordered[current], event);
    else if (event.key === "Escape") hideTip();
  });

  return {
    node: root,
    left: points.length - usable.length,
    /** Fades points that the legend has switched off. */
    filter(isOn) {
      for (const [p, node] of nodes) {
        node.classList.toggle("off", !isOn(p));
        node.setAttribute("aria-hidden", !isOn(p));
      }
    },
  };
}

/** A point with its whiskers; the circle that cannot be seen is easier to hit. */
function pointNode(p, xs, ys, { shape, colour }) {
  const [px, py] = [xs.at(p.x.value), ys.at(p.y.value)];
  const node = svg("g", {
    class: `point ${p.standing}`,
    tabindex: -1,
    role: "link",
    "aria-label": `${p.label}: ${interval(p.x)}, ${interval(p.y)}, ${STANDING[p.standing] || p.standing}`,
  });
  const bar = (x1, y1, x2, y2) => {
    const line = svg("line", { x1, y1, x2, y2, class: "whisker" });
    line.style.stroke = colour;
    node.append(line);
  };
  if (p.x.high > p.x.low) bar(xs.at(p.x.low), py, xs.at(p.x.high), py);
  if (p.y.high > p.y.low) bar(px, ys.at(p.y.low), px, ys.at(p.y.high));
  const mark = marker(shape, colour, {
    radius: p.standing === "front" ? 5.5 : 4.5,
    hollow: p.standing !== "front",
  });
  const place = svg(
    "g",
    { transform: `translate(${px} ${py})` },
    svg("circle", { r: 11, class: "target" }),
    mark,
  );
  node.append(place);
  return node;
}

/** What can be had at most: a stair, because nothing between two points has been measured. */
function stair(front, xs, ys, right) {
  const path = svg("path", { class: "front-line" });
  if (front.length === 0) return path;
  let d = "";
  front.forEach((p, i) => {
    const [px, py] = [xs.at(p.x.value), ys.at(p.y.value)];
    d += i === 0 ? `M${px} ${py}` : `H${px}V${py}`;
  });
  path.setAttribute("d", `${d}H${right}`);
  return path;
}

/** Axes with names, and lines to read by. */
function grid(xs, ys, right, bottom, x, y) {
  const node = svg("g", { class: "axes" });
  for (const t of xs.ticks(6)) {
    const px = xs.at(t);
    node.append(
      svg("line", { x1: px, x2: px, y1: MARGIN.top, y2: bottom, class: "grid" }),
      svg("text", { x: px, y: bottom + 17, "text-anchor": "middle" }, tick(t)),
    );
  }
  for (const t of ys.ticks(6)) {
    const py = ys.at(t);
    node.append(
      svg("line", { x1: MARGIN.left, x2: right, y1: py, y2: py, class: "grid" }),
      svg("text", { x: MARGIN.left - 8, y: py + 4, "text-anchor": "end" }, tick(t)),
    );
  }
  const name = (m, log) => `${m.name}${m.unit ? ` (${m.unit})` : ""}${log ? ", logarithmic" : ""}`;
  node.append(
    svg("path", { d: `M${MARGIN.left} ${MARGIN.top}V${bottom}H${right}`, class: "frame" }),
    svg(
      "text",
      { x: (MARGIN.left + right) / 2, y: HEIGHT - 8, "text-anchor": "middle", class: "axis-name" },
      name(x, xs.log),
    ),
    svg(
      "text",
      {
        transform: `translate(15 ${(MARGIN.top + bottom) / 2}) rotate(-90)`,
        "text-anchor": "middle",
        class: "axis-name",
      },
      name(y, ys.log),
    ),
  );
  return node;
}

/** The same numbers as a table, for whoever reads rather than looks. */
export function frontTable(scene, x, y, address) {
  const rank = { front: 0, within_noise: 1, dominated: 2 };
  const rows = [...scene.points].sort((a, b) => rank[a.standing] - rank[b.standing] || a.x.value - b.x.value);
  const head = (m) => [m.name, m.unit && h("span", { class: "unit" }, ` ${m.unit}`)];
  return set(
    h("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": `Points of ${scene.scene}` }),
    h(
      "table",
      null,
      h("caption", { class: "offscreen" }, `Points of ${scene.scene}`),
      h(
        "thead",
        null,
        h(
          "tr",
          null,
          h("th", { scope: "col" }, "combination"),
          h("th", { scope: "col", class: "n" }, head(x)),
          h("th", { scope: "col", class: "n" }, head(y)),
          h("th", { scope: "col" }, "standing"),
        ),
      ),
      h(
        "tbody",
        null,
        rows.map((p) =>
          h(
            "tr",
            null,
            h("th", { scope: "row" }, h("a", { href: address(p) }, p.label)),
            h("td", { class: "n" }, interval(p.x)),
            h("td", { class: "n" }, interval(p.y)),
            h(
              "td",
              null,
              p.standing.replace("_", " "),
              p.by?.length ? h("span", { class: "muted" }, ` by ${p.by.join(", ")}`) : null,
            ),
          ),
        ),
      ),
    ),
  );
}
