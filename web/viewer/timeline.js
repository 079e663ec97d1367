// Which frame: slider, buttons, playing, and a strip chart of the whole run under it
// with the current frame marked. It asks for frames and is told which one is shown.

import { button, el, number, select } from "./dom.js";
import { clamp } from "./math.js";

const CHART_HEIGHT = 52;
// The first and last frame stand clear of the edge.
const MARGIN_PX = 4;

/** `on`: `go(n)`, `play(playing)`, `loss()`. */
export class Timeline {
  constructor(frames, judged, on) {
    this.frames = frames;
    this.judged = judged;
    this.on = on;
    this.current = 0;
    this.playing = false;
    this.pace = 30;
    this.series = [];
    this.losses = new Map();
    this.build();
  }

  build() {
    const { frames } = this;
    const go = (n) => () => this.go(n());
    this.slider = el("input", { type: "range", min: 0, max: frames - 1, step: 1, value: 0, "aria-label": "Frame", class: "cmv-scrub" });
    this.slider.addEventListener("input", () => this.go(Number(this.slider.value)));
    this.entry = el("input", { type: "number", min: 0, max: frames - 1, step: 1, "aria-label": "Number of the frame", class: "cmv-entry" });
    this.entry.addEventListener("change", () => this.go(Number(this.entry.value)));
    this.playButton = button("▶", () => this.play(!this.playing), { "aria-label": "Play", title: "Play (space)" });
    const icon = (text, label, n) => button(text, go(n), { "aria-label": label, title: label });
    this.lossButton = button("Next loss", () => this.on.loss(), { title: "Next judged frame in which a seen triangle was lost (N)" });
    const pace = select("Frames a second when playing", [[5, "5 / s"], [10, "10 / s"], [30, "30 / s"], [60, "60 / s"]], 30, (p) => (this.pace = Number(p)));
    this.chart = el("canvas", { class: "cmv-chart", role: "img", "aria-label": "Numbers of every frame" });
    this.marker = el("div", { class: "cmv-marker" });
    this.caption = el("div", { class: "cmv-caption" });
    const strip = el("div", { class: "cmv-strip" }, this.chart, this.marker);
    const seek = (event) => {
      const box = this.chart.getBoundingClientRect();
      const t = (event.clientX - box.left - MARGIN_PX) / Math.max(box.width - 2 * MARGIN_PX, 1);
      this.go(Math.round(t * (frames - 1)));
    };
    // Captured, so that a drag may leave the narrow strip.
    strip.addEventListener("pointerdown", (event) => {
      strip.setPointerCapture(event.pointerId);
      seek(event);
    });
    strip.addEventListener("pointermove", (event) => event.buttons && seek(event));
    this.strip = strip;
    this.node = el("div", { class: "cmv-timeline" },
      el("div", { class: "cmv-transport" },
        icon("|◀", "First frame", () => 0), icon("‹", "One frame back", () => this.current - 1), this.playButton,
        icon("›", "One frame on", () => this.current + 1), icon("▶|", "Last frame", () => frames - 1), pace,
        el("label", { class: "cmv-inline" }, el("span", { text: "Frame" }), this.entry, el("span", { text: `of ${number(frames)}, from 0` })),
        this.lossButton),
      this.slider, strip, this.caption);
    // Where nothing was judged nothing is known of losses; the title says so.
    this.lossButton.disabled = this.judged.length === 0;
    if (this.judged.length === 0) this.lossButton.title = "No frame of this run was judged";
    this.observer = new ResizeObserver(() => this.paint());
    this.observer.observe(strip);
  }

  go(n) {
    // An emptied box is no frame: it shows the current one again.
    if (!Number.isFinite(n)) return this.show(this.current);
    const frame = clamp(Math.round(n), 0, this.frames - 1);
    this.show(frame);
    return this.on.go(frame);
  }

  /** Marks the frame that is wanted, without asking for it. */
  show(n) {
    this.current = n;
    this.slider.value = n;
    this.entry.value = n;
    this.slider.setAttribute("aria-valuetext", `frame ${n} of ${this.frames}`);
    this.mark();
    this.caption.textContent = this.said();
  }

  play(playing) {
    this.playing = playing;
    this.playButton.textContent = playing ? "❚❚" : "▶";
    this.playButton.setAttribute("aria-label", playing ? "Pause" : "Play");
    // From the end it begins anew, as players do.
    if (playing && this.current >= this.frames - 1) this.go(0);
    this.on.play(playing);
  }

  /** `[{name, unit, values}]`, one value a frame. */
  setSeries(series) {
    this.series = series.filter((s) => Array.isArray(s.values) && s.values.length > 0);
    // A strip with nothing on it would look broken.
    this.strip.hidden = this.series.length === 0 && this.judged.length === 0;
    this.paint();
    this.caption.textContent = this.said();
  }

  setLoss(frame, lost) {
    if (this.losses.get(frame) === lost) return;
    this.losses.set(frame, lost);
    this.paint();
  }

  /** The values at the current frame, in words. */
  said() {
    return this.series
      .map(({ name, unit, values }, i) => {
        const value = values[this.current];
        if (value === null || value === undefined) return "";
        const text = unit === "ns" && value >= 1000 ? `${(value / 1000).toFixed(1)} µs` : `${number(value)}${unit && unit !== name ? ` ${unit}` : ""}`;
        return `${i === 0 ? "━" : "┅"} ${name.replace(/_ns$/, "").replace(/_/g, " ")}: ${text}`;
      })
      .filter(Boolean)
      .join("   ");
  }

  at(n) {
    const width = this.strip.clientWidth - 2 * MARGIN_PX;
    return MARGIN_PX + (this.frames > 1 ? (n / (this.frames - 1)) * width : 0);
  }

  mark() {
    this.marker.style.transform = `translateX(${this.at(this.current)}px)`;
  }

  paint() {
    const width = this.strip.clientWidth;
    if (width === 0) return;
    const ratio = devicePixelRatio || 1;
    const { chart } = this;
    chart.width = Math.round(width * ratio);
    chart.height = Math.round(CHART_HEIGHT * ratio);
    const pen = chart.getContext("2d");
    pen.scale(ratio, ratio);
    const style = getComputedStyle(this.node);
    const colours = [style.getPropertyValue("--cmv-accent"), style.getPropertyValue("--cmv-muted")];
    const foot = CHART_HEIGHT - 7;
    // The later series lies behind: the first is what the picture shows.
    [...this.series].reverse().forEach((series) => {
      const index = this.series.indexOf(series);
      this.curve(pen, series.values, colours[index % 2], index > 0, foot);
    });
    for (const n of this.judged) {
      const lost = this.losses.get(n) ?? 0;
      pen.fillStyle = lost > 0 ? "#d6003b" : colours[1];
      if (lost > 0) pen.fillRect(this.at(n) - 1.5, 2, 3, CHART_HEIGHT - 2);
      else pen.fillRect(this.at(n) - 1, foot + 2, 2, 5);
    }
    this.mark();
  }

  /** Least to most of every column of pixels, so that no peak is lost in thousands of frames. */
  curve(pen, values, colour, dashed, foot) {
    // From zero, so that heights can be compared; the caption has the numbers.
    let most = 0;
    for (const v of values) if (v > most) most = v;
    if (most === 0) return;
    const y = (v) => foot - (v / most) * (foot - 4);
    pen.strokeStyle = colour;
    pen.lineWidth = 1.25;
    pen.setLineDash(dashed ? [3, 2] : []);
    pen.beginPath();
    let column = null;
    for (let n = 0; n < values.length; n++) {
      const v = values[n];
      if (v === null) continue;
      const x = Math.round(this.at(n) * 2) / 2;
      if (column && x === column.x) {
        column.lo = Math.min(column.lo, v);
        column.hi = Math.max(column.hi, v);
        continue;
      }
      if (column) pen.lineTo(column.x, y(column.lo)), pen.lineTo(column.x, y(column.hi));
      column = { x, lo: v, hi: v };
    }
    if (column) pen.lineTo(column.x, y(column.lo)), pen.lineTo(column.x, y(column.hi));
    pen.stroke();
  }

  destroy() {
    this.observer.disconnect();
  }
}
