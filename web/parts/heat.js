// The heat map: a canvas as large as the window of a scrolling box, in which only the
// cells in view are drawn. Pointer and arrow keys pick a cell; Enter or a click opens it.

import { h, onceAFrame } from "/parts/dom.js";
import { number } from "/parts/format.js";
import { colourSteps } from "/parts/heat-data.js";
import { drawMark, hatch, labelCutter, overview } from "/parts/heat-paint.js";
import { ramp } from "/parts/scales.js";
import { ink, watchTheme } from "/parts/theme.js";

const FONT = "12px Inter, system-ui, sans-serif";
const CELL = { leastWidth: 5, mostWidth: 160, leastHeight: 5, mostHeight: 44 };
// What one can still read and hit: smaller only on demand.
const READABLE = { width: 14, height: 17 };
// Up to this size cells touch each other.
const GAPLESS = 8;
const PAD = 8;
const clamp = (x, low, high) => Math.max(low, Math.min(high, x));

/** `onHover(k | -1, x, y)`, `onFocus(k)`, `onOpen(k)`: k is the index of a cell. */
export function heatMap({ label, onHover, onFocus, onOpen, signal }) {
  const canvas = h("canvas", { class: "heat-canvas" });
  const spacer = h("div", { class: "heat-space" }, canvas);
  const box = h(
    "div",
    {
      class: "heat",
      tabindex: 0,
      role: "application",
      "aria-roledescription": "heat map",
      "aria-label": label,
    },
    spacer,
  );
  const context = canvas.getContext("2d");
  const cut = labelCutter(context);
  let data = null;
  let log = false;
  let zoom = 1;
  let colours = null;
  // One pixel a cell, made when small cells are first drawn.
  let picture = null;
  let lut = [];
  let size = { left: 0, top: 0, cell: [20, 20], upright: true };
  let focus = [0, 0];
  let hover = [-1, -1];
  let theme = {};
  // Scrolling that follows the focus keeps the tooltip, which follows it too.
  let revealing = false;

  /** Colours of the style sheet, read once a theme: asking for them in every cell would be slow. */
  function readTheme() {
    lut = ramp(document.documentElement.dataset.theme === "dark");
    for (const name of ["ink", "muted", "line", "card", "shade", "alarm", "hatch", "accent"])
      theme[name] = ink(`--${name}`);
    theme.pending = hatch(theme.hatch, theme.card);
    picture = null;
  }

  /** Sizes of labels and cells for the room there is. */
  function layout() {
    if (!data) return;
    context.font = FONT;
    const widest = (labels) => labels.reduce((w, t) => Math.max(w, context.measureText(t).width), 0);
    const room = box.clientWidth;
    const left = Math.ceil(Math.min(widest(data.down) + 2 * PAD, room * 0.42, 380));
    const fitWidth = (room - left - PAD) / data.across.length;
    const least = zoom < 1 ? CELL.leastWidth : READABLE.width;
    const width = clamp(clamp(fitWidth, least, 110) * zoom, CELL.leastWidth, CELL.mostWidth);
    const labelWidth = widest(data.across) + PAD;
    const upright = labelWidth <= width;
    // Upright labels need a line; slanted ones as much as the longest, within reason.
    const top = upright ? 26 : Math.ceil(Math.min(labelWidth, 190) * 0.87 + 14);
    const fitHeight = (Math.min(innerHeight * 0.66, 720) - top) / data.down.length;
    const height = clamp(
      clamp(fitHeight, zoom < 1 ? CELL.leastHeight : READABLE.height, 30) * zoom,
      CELL.leastHeight,
      CELL.mostHeight,
    );
    size = { left, top, cell: [width, height], upright };
    const lean = upright ? 0 : Math.min(labelWidth, 190) * 0.5;
    spacer.style.width = `${Math.ceil(left + width * data.across.length + lean + 2)}px`;
    spacer.style.height = `${Math.ceil(top + height * data.down.length + 2)}px`;
    box.style.height = `${Math.min(Math.ceil(top + height * data.down.length + 22), Math.max(320, innerHeight * 0.72))}px`;
    fitCanvas();
  }

  /** The canvas has the size of the box, in pixels of the screen. */
  function fitCanvas() {
    const ratio = devicePixelRatio || 1;
    const [w, hgt] = [box.clientWidth, box.clientHeight];
    if (canvas.width !== Math.round(w * ratio) || canvas.height !== Math.round(hgt * ratio)) {
      canvas.width = Math.round(w * ratio);
      canvas.height = Math.round(hgt * ratio);
      canvas.style.width = `${w}px`;
      canvas.style.height = `${hgt}px`;
    }
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    draw();
  }

  const draw = onceAFrame(() => {
    if (!data || signal.aborted) return;
    const { left, top, cell } = size;
    const [w, hgt] = [box.clientWidth, box.clientHeight];
    const [sx, sy] = [box.scrollLeft, box.scrollTop];
    context.fillStyle = theme.card;
    context.fillRect(0, 0, w, hgt);
    const x0 = clamp(Math.floor(sx / cell[0]), 0, data.across.length);
    const x1 = clamp(Math.ceil((sx + w - left) / cell[0]), 0, data.across.length);
    const y0 = clamp(Math.floor(sy / cell[1]), 0, data.down.length);
    const y1 = clamp(Math.ceil((sy + hgt - top) / cell[1]), 0, data.down.length);
    context.save();
    context.beginPath();
    context.rect(left, top, w - left, hgt - top);
    context.clip();
    const small = Math.min(...cell) <= GAPLESS ? (picture ??= overview(data, colours, lut)) : null;
    if (small) {
      context.imageSmoothingEnabled = false;
      const [w1, h1] = [(x1 - x0) * cell[0], (y1 - y0) * cell[1]];
      context.drawImage(
        small.canvas,
        x0,
        y0,
        x1 - x0,
        y1 - y0,
        left + x0 * cell[0] - sx,
        top + y0 * cell[1] - sy,
        w1,
        h1,
      );
    }
    for (let y = y0; y < y1; y += 1) {
      for (let x = x0; x < x1; x += 1) {
        if (!small || small.isMarked(x, y)) drawCell(x, y, left + x * cell[0] - sx, top + y * cell[1] - sy);
      }
    }
    outline(hover, theme.ink, 1.5);
    if (document.activeElement === box) outline(focus, theme.accent, 3);
    context.restore();
    labels(x0, x1, y0, y1);
  });

  /** Value as colour, state as mark, and the number where there is room for it. */
  function drawCell(x, y, px, py) {
    const k = data.cellAt(x, y);
    if (k < 0) return;
    const [w, hgt] = size.cell;
    // A gap between cells, where there is room for one.
    const gap = Math.min(w, hgt) > GAPLESS ? 1 : 0;
    const [cw, ch] = [w - gap, hgt - gap];
    const status = data.statusOf(k);
    const coloured = colours.has(k);
    const colour = coloured ? lut[colours.steps[k]] : null;
    context.fillStyle = coloured ? colour.fill : status === "pending" ? theme.pending : theme.shade;
    context.fillRect(px, py, cw, ch);
    const mark = coloured ? colour.ink : status === "failed" || status === "wrong" ? theme.alarm : theme.muted;
    if (status === "failed" || status === "wrong") drawMark(context, status, [px, py, cw, ch], mark, coloured);
    else if (coloured && w >= 46 && hgt >= 16) text(number(data.values[k]), px + cw / 2, py + ch / 2, mark);
    else if (!coloured && status === "done" && w >= 12 && hgt >= 12) text("–", px + cw / 2, py + ch / 2, mark);
  }

  /** A short text in the middle of a cell. */
  function text(t, x, y, colour) {
    context.fillStyle = colour;
    context.font = FONT;
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.fillText(t, x, y + 0.5);
  }

  /** Labels of the cell under the pointer, or of the one with the focus, stand out. */
  const isPicked = (axis, i) => i === hover[axis] || (i === focus[axis] && document.activeElement === box);

  /** Names of rows and columns over the cells that scrolled below them; as many as can be read. */
  function labels(x0, x1, y0, y1) {
    const { left, top, cell, upright } = size;
    const [sx, sy] = [box.scrollLeft, box.scrollTop];
    context.font = FONT;
    context.textBaseline = "middle";
    context.fillStyle = theme.card;
    context.fillRect(0, top, left, box.clientHeight - top);
    const everyRow = Math.ceil(13 / cell[1]);
    context.textAlign = "right";
    for (let y = y0; y < y1; y += 1) {
      if (y % everyRow) continue;
      const py = top + (y + 0.5) * cell[1] - sy;
      if (py < top) continue;
      context.fillStyle = isPicked(1, y) ? theme.ink : theme.muted;
      context.fillText(cut(data.down[y], left - PAD - 4), left - PAD, py);
    }
    context.fillStyle = theme.card;
    context.fillRect(0, 0, box.clientWidth, top);
    const everyColumn = Math.ceil(14 / cell[0]);
    context.save();
    context.beginPath();
    context.rect(left - 4, 0, box.clientWidth, top);
    context.clip();
    for (let x = x0; x < x1; x += 1) {
      if (x % everyColumn) continue;
      const px = left + (x + 0.5) * cell[0] - sx;
      context.fillStyle = isPicked(0, x) ? theme.ink : theme.muted;
      if (upright) {
        context.textAlign = "center";
        context.fillText(data.across[x], px, top - 11);
      } else {
        context.save();
        context.translate(px + 3, top - 6);
        context.rotate(-Math.PI / 3);
        context.textAlign = "left";
        context.fillText(cut(data.across[x], 186), 0, 0);
        context.restore();
      }
    }
    context.restore();
  }

  /** A frame around a cell. */
  function outline([x, y], colour, lineWidth) {
    if (x < 0 || y < 0) return;
    const { left, top, cell } = size;
    context.strokeStyle = colour;
    context.lineWidth = lineWidth;
    context.strokeRect(
      left + x * cell[0] - box.scrollLeft,
      top + y * cell[1] - box.scrollTop,
      cell[0] - 1,
      cell[1] - 1,
    );
  }

  /** The cell below the pointer. */
  function cellUnder(event) {
    const edge = box.getBoundingClientRect();
    const [x, y] = [event.clientX - edge.left - size.left, event.clientY - edge.top - size.top];
    if (x < 0 || y < 0) return [-1, -1];
    return [Math.floor((x + box.scrollLeft) / size.cell[0]), Math.floor((y + box.scrollTop) / size.cell[1])];
  }

  /** Scrolls a cell into view. */
  function reveal([x, y]) {
    const { left, top, cell } = size;
    const [px, py] = [x * cell[0], y * cell[1]];
    const before = [box.scrollLeft, box.scrollTop];
    if (px < box.scrollLeft) box.scrollLeft = px;
    if (px + cell[0] > box.scrollLeft + box.clientWidth - left)
      box.scrollLeft = px + cell[0] - box.clientWidth + left;
    if (py < box.scrollTop) box.scrollTop = py;
    if (py + cell[1] > box.scrollTop + box.clientHeight - top)
      box.scrollTop = py + cell[1] - box.clientHeight + top;
    revealing = before[0] !== box.scrollLeft || before[1] !== box.scrollTop;
  }

  /** Middle of the focused cell in the window, for the tooltip. */
  function focusPoint() {
    const edge = box.getBoundingClientRect();
    const { left, top, cell } = size;
    return [
      edge.left + left + (focus[0] + 0.5) * cell[0] - box.scrollLeft,
      edge.top + top + (focus[1] + 0.5) * cell[1] - box.scrollTop,
    ];
  }

  /** Picks a cell by keyboard. */
  function moveFocus(x, y) {
    focus = [clamp(x, 0, data.across.length - 1), clamp(y, 0, data.down.length - 1)];
    reveal(focus);
    draw();
    const k = data.cellAt(...focus);
    onFocus(k);
    onHover(k, ...focusPoint());
  }

  box.addEventListener("keydown", (event) => {
    if (!data || event.ctrlKey || event.metaKey || event.altKey) return;
    const [x, y] = focus;
    const page = Math.max(1, Math.floor((box.clientHeight - size.top) / size.cell[1]) - 1);
    const to = {
      ArrowLeft: [x - 1, y],
      ArrowRight: [x + 1, y],
      ArrowUp: [x, y - 1],
      ArrowDown: [x, y + 1],
      Home: [0, y],
      End: [data.across.length - 1, y],
      PageUp: [x, y - page],
      PageDown: [x, y + page],
    }[event.key];
    if (to) moveFocus(...to);
    else if (event.key === "Enter" && data.cellAt(x, y) >= 0) onOpen(data.cellAt(x, y));
    else if (event.key === "+" || event.key === "=") api.zoomBy(1.3);
    else if (event.key === "-") api.zoomBy(1 / 1.3);
    else if (event.key === "0") api.zoomBy(0);
    else if (event.key === "Escape") onHover(-1, 0, 0);
    else return;
    event.preventDefault();
  });
  box.addEventListener("focus", () => data && moveFocus(...focus));
  box.addEventListener("blur", () => (onHover(-1, 0, 0), draw()));
  const scrolled = () => {
    draw();
    // What the pointer or the focus was on has moved away from its tooltip.
    if (!revealing) onHover(-1, 0, 0);
    revealing = false;
  };
  box.addEventListener("scroll", scrolled, { passive: true });
  box.addEventListener("pointermove", (event) => {
    if (!data) return;
    const cell = cellUnder(event);
    const k = data.cellAt(...cell);
    hover = k < 0 ? [-1, -1] : cell;
    box.classList.toggle("over-cell", k >= 0);
    onHover(k, event.clientX, event.clientY);
    draw();
  });
  box.addEventListener("pointerleave", () => {
    hover = [-1, -1];
    onHover(-1, 0, 0);
    draw();
  });
  box.addEventListener("click", (event) => {
    const k = data ? data.cellAt(...cellUnder(event)) : -1;
    if (k >= 0) onOpen(k, event);
  });

  const watcher = new ResizeObserver(() => layout());
  watcher.observe(box);
  signal.addEventListener("abort", () => watcher.disconnect());
  readTheme();
  watchTheme(() => (readTheme(), draw()), signal);

  const api = {
    node: box,
    /** Shows data; returns what its colours mean. */
    show(next, useLog) {
      const turned = data && data.turned !== next.turned;
      data = next;
      log = useLog;
      colours = colourSteps(data.values, log);
      picture = null;
      if (turned) [focus, box.scrollLeft, box.scrollTop] = [[0, 0], 0, 0];
      focus = [Math.min(focus[0], data.across.length - 1), Math.min(focus[1], data.down.length - 1)];
      layout();
      return colours;
    },
    /** Times `factor`; 0 is back to the usual size. */
    zoomBy(factor) {
      zoom = factor === 0 ? 1 : clamp(zoom * factor, 0.05, 8);
      layout();
    },
    redraw: draw,
  };
  return api;
}
