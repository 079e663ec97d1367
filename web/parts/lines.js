// Charts of every frame of a path, one above the other, that share crosshair and zoom.
// Where several frames fall on one pixel their least and greatest value are drawn, so
// that no spike is lost and tens of thousands of frames stay smooth.

import { h, onceAFrame, set, setText, throttle } from "/parts/dom.js";
import { number, tick } from "/parts/format.js";
import { axis, extent } from "/parts/scales.js";
import { ink, watchTheme } from "/parts/theme.js";

const HEIGHT = 132;
const LEFT = 62;
const RIGHT = 10;
const TOP = 8;
const BOTTOM = 22;
const LEAST_FRAMES = 8;
const FONT = "11px Inter, system-ui, sans-serif";

/** Nanoseconds in the unit that suits their size; other units as they are. */
function unitOf(unit, values) {
  const most = extent(values)?.[1] || 0;
  if (unit !== "ns") return { unit, scale: 1 };
  if (most >= 1e7) return { unit: "ms", scale: 1e-6 };
  return most >= 1e4 ? { unit: "µs", scale: 1e-3 } : { unit, scale: 1 };
}

/**
 * `charts`: `[{name, title, unit, values, others: [values]}]`, `others` drawn pale.
 * `marks`: `[{frame, bad}]` on the time axis. `onFrame(frame)` as the crosshair moves.
 */
export function frameCharts({ charts, frames, marks = [], onFrame, signal }) {
  const group = { range: [0, Math.max(1, frames - 1)], hover: -1, drag: null };
  const readout = h("p", { class: "readout" }, "Move over a chart, or focus one and use the arrow keys.");
  const spoken = h("p", { class: "offscreen", "aria-live": "polite" });
  const reset = h(
    "button",
    { type: "button", class: "small", hidden: true, onclick: () => zoom(0, frames - 1) },
    "Show all frames",
  );
  const parts = charts.map((c) => chart({ ...c, ...unitOf(c.unit, c.values), rawUnit: c.unit }));
  const say = throttle(() => setText(spoken, readout.textContent), 900);
  signal.addEventListener("abort", () => say.cancel());

  /** All charts: they share crosshair and range. */
  function redraw() {
    for (const p of parts) p.draw();
  }

  /** Puts the crosshair on a frame, -1 takes it away. */
  function moveTo(frame, { speak = false } = {}) {
    const f = frame < 0 ? -1 : Math.max(0, Math.min(frames - 1, Math.round(frame)));
    if (f === group.hover) return;
    group.hover = f;
    if (f >= 0) {
      set(
        readout,
        h("b", null, `Frame ${number(f)}`),
        parts.map((p) =>
          h(
            "span",
            null,
            ` ${p.title} `,
            h("b", null, number(p.values[f] * p.scale)),
            p.unit && p.unit !== p.title && ` ${p.unit}`,
          ),
        ),
      );
      // The crosshair of a drag may leave the range that is shown.
      if (f < group.range[0] || f > group.range[1]) pan(f);
    }
    onFrame(f);
    if (speak) say();
    redraw();
  }

  /** Moves the range so that a frame is in it, as far as there are frames. */
  function pan(f) {
    const width = group.range[1] - group.range[0];
    const from = Math.max(0, Math.min(frames - 1 - width, f - width / 2));
    group.range = [from, from + width];
  }

  /** Shows frames from, to; never fewer than can be told apart. */
  function zoom(from, to) {
    let [a, b] = [Math.max(0, Math.min(from, to)), Math.min(frames - 1, Math.max(from, to))];
    if (b - a < LEAST_FRAMES) {
      const middle = (a + b) / 2;
      [a, b] = [Math.max(0, middle - LEAST_FRAMES / 2), Math.min(frames - 1, middle + LEAST_FRAMES / 2)];
    }
    group.range = [a, Math.max(b, a + 1)];
    reset.hidden = a <= 0 && b >= frames - 1;
    redraw();
  }

  /** Around the crosshair, else around the middle. */
  function zoomBy(factor) {
    const [a, b] = group.range;
    const middle = group.hover >= 0 ? group.hover : (a + b) / 2;
    zoom(middle - (middle - a) * factor, middle + (b - middle) * factor);
  }

  /** One chart: its canvas, its axes and what the pointer and keys do. */
  function chart(c) {
    const canvas = h("canvas");
    const box = h(
      "div",
      {
        class: "lines",
        tabindex: 0,
        role: "application",
        "aria-roledescription": "chart of frames",
        "aria-label": `${c.title}${c.unit ? ` in ${c.unit}` : ""} over ${frames} frames. Arrow keys move from frame to frame, plus and minus zoom.`,
      },
      canvas,
    );
    const node = h(
      "figure",
      { class: "frame-chart" },
      h(
        "figcaption",
        null,
        h("b", null, c.title),
        c.unit && c.unit !== c.title && h("span", { class: "muted" }, ` in ${c.unit}`),
        c.about && h("span", { class: "muted" }, `, ${c.about}`),
      ),
      box,
    );
    const context = canvas.getContext("2d");
    let width = 0;

    // Pixels and frames, both ways.
    const toFrame = (px) =>
      group.range[0] + ((px - LEFT) / (width - LEFT - RIGHT)) * (group.range[1] - group.range[0]);
    const toX = (f) =>
      LEFT + ((f - group.range[0]) / (group.range[1] - group.range[0])) * (width - LEFT - RIGHT);

    const draw = onceAFrame(() => {
      if (signal.aborted || !width) return;
      const ratio = devicePixelRatio || 1;
      if (canvas.width !== Math.round(width * ratio)) {
        canvas.width = Math.round(width * ratio);
        canvas.height = Math.round(HEIGHT * ratio);
        canvas.style.width = `${width}px`;
        canvas.style.height = `${HEIGHT}px`;
      }
      context.setTransform(ratio, 0, 0, ratio, 0, 0);
      context.clearRect(0, 0, width, HEIGHT);
      const [from, to] = [Math.floor(group.range[0]), Math.ceil(group.range[1])];
      const seen = [c.values, ...(c.others || [])].map((v) => extent(v.slice(from, to + 1))).filter(Boolean);
      const bottom = HEIGHT - BOTTOM;
      const ys = axis(
        seen.length
          ? [Math.min(...seen.map((e) => e[0])) * c.scale, Math.max(...seen.map((e) => e[1])) * c.scale]
          : null,
        [bottom, TOP],
        { zero: true, pad: 0.05 },
      );
      drawAxes(ys, bottom, from, to);
      context.save();
      context.beginPath();
      context.rect(LEFT, 0, width - LEFT - RIGHT, HEIGHT);
      context.clip();
      context.lineJoin = "round";
      for (const other of c.others || []) line(other, ys, ink("--c5"), 0.8, 0.45);
      line(c.values, ys, ink("--accent"), 1.5, 1);
      context.restore();
      // Not clipped: half of the mark of the first or last frame lies beyond the axis.
      drawMarks(bottom);
      context.save();
      context.beginPath();
      context.rect(LEFT, 0, width - LEFT - RIGHT, HEIGHT);
      context.clip();
      drawPointer(ys, bottom);
      context.restore();
    });

    /** Few lines, round numbers, whole frames. */
    function drawAxes(ys, bottom, from, to) {
      context.font = FONT;
      context.fillStyle = ink("--muted");
      context.strokeStyle = ink("--grid");
      context.lineWidth = 1;
      context.textAlign = "right";
      context.textBaseline = "middle";
      for (const t of ys.ticks(4)) {
        const y = Math.round(ys.at(t)) + 0.5;
        context.beginPath();
        context.moveTo(LEFT, y);
        context.lineTo(width - RIGHT, y);
        context.stroke();
        context.fillText(tick(t), LEFT - 7, y);
      }
      context.textAlign = "center";
      context.textBaseline = "alphabetic";
      for (const t of axis([from, to], [LEFT, width - RIGHT], { pad: 0 }).ticks(
        Math.max(3, Math.floor(width / 110)),
      )) {
        if (!Number.isInteger(t)) continue;
        context.fillText(number(t), toX(t), HEIGHT - 6);
      }
      context.strokeStyle = ink("--edge");
      context.beginPath();
      context.moveTo(LEFT + 0.5, TOP);
      context.lineTo(LEFT + 0.5, bottom + 0.5);
      context.lineTo(width - RIGHT, bottom + 0.5);
      context.stroke();
    }

    /** A series: every frame where there is room, else the extent of each column of pixels. */
    function line(values, ys, colour, lineWidth, alpha) {
      const [from, to] = [
        Math.max(0, Math.floor(group.range[0]) - 1),
        Math.min(values.length - 1, Math.ceil(group.range[1]) + 1),
      ];
      context.strokeStyle = colour;
      context.globalAlpha = alpha;
      context.lineWidth = lineWidth;
      context.beginPath();
      if ((to - from) / (width - LEFT - RIGHT) < 1.5) {
        for (let f = from; f <= to; f += 1)
          if (Number.isFinite(values[f])) context.lineTo(toX(f), ys.at(values[f] * c.scale));
      } else {
        let [column, low, high] = [-1, Infinity, -Infinity];
        for (let f = from; f <= to; f += 1) {
          const x = Math.floor(toX(f));
          if (x !== column && column >= 0 && low <= high) {
            context.lineTo(column, ys.at(low * c.scale));
            context.lineTo(column, ys.at(high * c.scale));
            [low, high] = [Infinity, -Infinity];
          }
          column = x;
          if (values[f] < low) low = values[f];
          if (values[f] > high) high = values[f];
        }
      }
      context.stroke();
      context.globalAlpha = 1;
    }

    /** Judged frames on the axis: a tick; a red triangle where something was lost. */
    function drawMarks(bottom) {
      for (const m of marks) {
        if (m.frame < group.range[0] || m.frame > group.range[1]) continue;
        const x = toX(m.frame);
        context.fillStyle = ink(m.bad ? "--alarm" : "--good");
        if (!m.bad) context.fillRect(x - 0.75, bottom - 5, 1.5, 5);
        else {
          context.beginPath();
          context.moveTo(x - 4, bottom);
          context.lineTo(x + 4, bottom);
          context.lineTo(x, bottom - 9);
          context.fill();
        }
      }
    }

    /** What is being dragged over, and the crosshair with the value it meets. */
    function drawPointer(ys, bottom) {
      if (group.drag) {
        context.fillStyle = ink("--accent");
        context.globalAlpha = 0.15;
        const [a, b] = group.drag.map(toX);
        context.fillRect(Math.min(a, b), TOP, Math.abs(b - a), bottom - TOP);
        context.globalAlpha = 1;
      }
      if (group.hover < 0) return;
      const x = toX(group.hover);
      context.strokeStyle = ink("--ink");
      context.lineWidth = 1;
      context.setLineDash([3, 3]);
      context.beginPath();
      context.moveTo(x, TOP);
      context.lineTo(x, bottom);
      context.stroke();
      context.setLineDash([]);
      const v = c.values[group.hover];
      if (!Number.isFinite(v)) return;
      context.fillStyle = ink("--accent");
      context.beginPath();
      context.arc(x, ys.at(v * c.scale), 3.5, 0, 2 * Math.PI);
      context.fill();
    }

    const frameAt = (event) => toFrame(event.clientX - box.getBoundingClientRect().left);
    box.addEventListener("pointermove", (event) => {
      if (group.drag) group.drag[1] = frameAt(event);
      moveTo(Math.max(0, frameAt(event)));
      if (group.drag) redraw();
    });
    box.addEventListener("pointerdown", (event) => {
      if (event.button !== 0 || event.pointerType === "touch") return;
      box.setPointerCapture(event.pointerId);
      group.drag = [frameAt(event), frameAt(event)];
    });
    box.addEventListener("pointerup", () => {
      if (!group.drag) return;
      const [a, b] = group.drag;
      group.drag = null;
      // A click is no zoom.
      if (Math.abs(toX(a) - toX(b)) > 6) zoom(a, b);
      else redraw();
    });
    box.addEventListener("pointercancel", () => ((group.drag = null), redraw()));
    box.addEventListener("dblclick", () => zoom(0, frames - 1));
    box.addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      const step = event.shiftKey ? 10 : 1;
      const at = group.hover < 0 ? Math.round(group.range[0]) : group.hover;
      const to = {
        ArrowRight: at + step,
        ArrowLeft: Math.max(0, at - step),
        Home: 0,
        End: frames - 1,
        PageUp: Math.max(0, at - 100),
        PageDown: at + 100,
      }[event.key];
      if (to !== undefined) moveTo(to, { speak: true });
      else if (event.key === "+" || event.key === "=") zoomBy(0.6);
      else if (event.key === "-") zoomBy(1 / 0.6);
      else if (event.key === "0" || event.key === "Escape") zoom(0, frames - 1);
      else return;
      event.preventDefault();
    });
    const watcher = new ResizeObserver(() => {
      width = box.clientWidth;
      draw();
    });
    watcher.observe(box);
    signal.addEventListener("abort", () => watcher.disconnect());
    return { ...c, node, draw };
  }

  watchTheme(redraw, signal);
  return {
    node: h(
      "div",
      { class: "frame-charts" },
      h("div", { class: "readout-row" }, readout, reset),
      parts.map((p) => p.node),
      spoken,
    ),
    moveTo,
    zoom,
  };
}
