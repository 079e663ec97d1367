// The path recorder: flights as they are flown, or key poses with frames between them;
// previewed, undone, saved as CSV or uploaded for manifests to name.

import { button, el, explain, freshId, number, save, select } from "./dom.js";
import { clamp } from "./math.js";
import { pathSegments } from "./plan.js";
import { clonePose, csv, interpolate, pathLength, placementOf, Sampler } from "./poses.js";

// More than two hours at thirty a second: a key that was forgotten, not a path.
const MOST_FRAMES = 200_000;
const MOST_BETWEEN = 10_000;
// The line behind the flight grows in steps: sending it to the GPU each time would be felt.
const REDRAW_EVERY = 6;
const LINE_STATE = "cmv-recording";

export class Recorder {
  /** `stage` is flown through, `view` says how the scene was placed, `say(text)` tells the reader. */
  constructor(stage, view, api, say) {
    Object.assign(this, { stage, api, say });
    this.placement = placementOf(view);
    this.hertz = 30;
    this.gap = 30;
    this.poses = [];
    this.keys = [];
    this.history = [];
    this.build();
    this.changed();
  }

  build() {
    this.recordButton = button("● Record", () => this.toggle(), { title: "Records the flight, and stops (R)", "aria-pressed": "false" });
    const rate = select("Poses a second", [[30, "30 poses / s"], [60, "60 poses / s"]], 30, (h) => (this.hertz = Number(h)));
    // Changing it spaces the key poses anew, so that one can try what looks right.
    const gap = el("input", { type: "number", min: 1, max: MOST_BETWEEN, step: 1, value: this.gap, class: "cmv-entry" });
    gap.addEventListener("change", () => {
      this.gap = clamp(Math.round(Number(gap.value)) || 1, 1, MOST_BETWEEN);
      gap.value = this.gap;
      if (this.keys.length) this.set(interpolate(this.keys, this.gap), this.keys);
    });
    this.info = el("p", { class: "cmv-note" });
    this.previewButton = button("Preview", () => this.preview(!this.previewing));
    this.undoButton = button("Undo", () => this.undo(), { title: "Ctrl+Z" });
    this.clearButton = button("Clear", () => this.remember(() => this.set([], [])));
    const nameId = freshId();
    this.nameEntry = el("input", { type: "text", id: nameId, value: "walk.csv", spellcheck: "false", class: "cmv-name" });
    this.saveButton = button("Save CSV", () => this.download());
    this.uploadButton = button("Upload", () => this.upload());
    this.progress = el("progress", { max: 1, value: 0, hidden: true, "aria-label": "Upload" });
    this.result = el("div", { class: "cmv-result", hidden: true });
    const row = (...children) => el("div", { class: "cmv-row" }, ...children);
    this.node = el("details", { class: "cmv-section" }, el("summary", { text: "Record a path" }),
      row(this.recordButton, rate),
      row(button("Place key pose", () => this.place(), { title: "A pose of the path where the camera is now (P)" }),
        el("label", { class: "cmv-inline" }, gap, el("span", { text: "frames to the next" }))),
      this.info, row(this.previewButton, this.undoButton, this.clearButton),
      row(el("label", { for: nameId, text: "Name" }), this.nameEntry), row(this.saveButton, this.uploadButton), this.progress,
      this.result, el("p", { class: "cmv-note", text: this.axesNote() }));
  }

  axesNote() {
    const { told, up, scale, offset } = this.placement;
    if (!told) {
      return 'Poses are written in metres with z up, as cullmark sees the scene. The scene must be named with up = "z" and no scale or offset; the server did not say how it was placed.';
    }
    const [x, y, z] = offset;
    const moved = x || y || z ? `, offset_m = { x = ${x}, y = ${y}, z = ${z} }` : "";
    return `Poses are written in the units and axes of the scene's file. The manifest must name that scene with up = "${up}", scale = ${scale}${moved}, as here.`;
  }

  /** For undoing: what the path was before `act`. */
  remember(act) {
    this.history.push([this.poses, this.keys]);
    act();
  }

  set(poses, keys) {
    // Key poses multiply: refused before they are made part of the path.
    if (poses.length > MOST_FRAMES) {
      this.say(`A path of ${number(poses.length)} frames is too long: ${number(MOST_FRAMES)} at most`);
      return;
    }
    this.poses = poses;
    this.keys = keys;
    this.changed();
  }

  undo() {
    if (this.sampler) this.toggle();
    const last = this.history.pop();
    if (last) this.set(...last);
  }

  changed() {
    const { poses, keys } = this;
    this.drawn = poses.length;
    const { data, count } = pathSegments(poses.map((p) => p.eye));
    this.stage.renderer.setLines("record", data, count);
    this.stage.invalidate();
    const of = keys.length ? ` from ${keys.length} key pose${keys.length > 1 ? "s" : ""}` : "";
    this.info.textContent = poses.length
      ? `${number(poses.length)} frame${poses.length > 1 ? "s" : ""}${of}, ${pathLength(poses).toFixed(1)} m, ${(poses.length / this.hertz).toFixed(1)} s at ${this.hertz} a second`
      : "No path yet: fly and record, or place key poses.";
    this.buttons();
  }

  /** What cannot be done now is disabled: nothing to save, nothing to undo. */
  buttons() {
    const none = this.poses.length === 0 || Boolean(this.sampler);
    for (const b of [this.previewButton, this.saveButton, this.uploadButton, this.clearButton]) b.disabled = none;
    this.undoButton.disabled = this.history.length === 0 && !this.sampler;
    this.recordButton.textContent = this.sampler ? "■ Stop" : "● Record";
    this.recordButton.setAttribute("aria-pressed", String(Boolean(this.sampler)));
    this.previewButton.textContent = this.previewing ? "Stop preview" : "Preview";
  }

  /** Poses are those of free flight in the camera's view: there it goes first. */
  ready() {
    this.node.open = true;
    this.preview(false);
    if (this.stage.layout === "right") this.stage.on.layout("both");
    this.stage.takeOff();
  }

  toggle() {
    const { stage } = this;
    if (this.sampler) {
      const { poses } = this.sampler;
      this.sampler = null;
      stage.tickers.delete(this.ticker);
      stage.node.classList.remove(LINE_STATE);
      this.set(poses, []);
      this.say(`Recorded ${number(poses.length)} frames`);
      return;
    }
    this.ready();
    // A recording replaces the path; undo brings the old one back.
    this.history.push([this.poses, this.keys]);
    const sampler = new Sampler(this.hertz);
    this.sampler = sampler;
    this.keys = [];
    this.ticker = (now) => {
      sampler.take(now, stage.pose);
      // Full: what there is is kept.
      if (sampler.poses.length >= MOST_FRAMES) this.toggle();
      if (sampler.poses.length - this.drawn >= REDRAW_EVERY || sampler.poses.length < this.drawn) {
        this.poses = sampler.poses;
        this.changed();
      }
      return true;
    };
    stage.tickers.add(this.ticker);
    stage.node.classList.add(LINE_STATE);
    this.say("Recording: W A S D Q E fly, dragging looks, R stops");
    this.buttons();
    stage.invalidate();
  }

  place() {
    if (this.sampler) return;
    this.ready();
    const keys = [...this.keys, clonePose(this.stage.pose)];
    this.remember(() => this.set(interpolate(keys, this.gap), keys));
    this.say(`Key pose ${keys.length} placed`);
  }

  /** Flies the camera along the path at the pace at which it was recorded. */
  preview(on) {
    if (Boolean(this.previewing) === on) return;
    const { stage } = this;
    if (this.previewing) stage.tickers.delete(this.previewing);
    this.previewing = null;
    if (on) {
      stage.takeOff();
      let start = 0;
      this.previewing = (now) => {
        start ||= now;
        const n = Math.floor(((now - start) * this.hertz) / 1000);
        stage.fly.setPose(this.poses[Math.min(n, this.poses.length - 1)]);
        stage.dirty = true;
        if (n >= this.poses.length - 1) this.preview(false);
        return true;
      };
      stage.tickers.add(this.previewing);
      stage.invalidate();
    }
    this.buttons();
  }

  /** The typed name as that of a file: no folders, and the ending that the server goes by. */
  get name() {
    const typed = this.nameEntry.value.trim().replace(/[/\\]/g, "-") || "walk";
    return typed.endsWith(".csv") ? typed : `${typed}.csv`;
  }

  blob() {
    return new Blob([csv(this.poses, this.placement)], { type: "text/csv" });
  }

  download() {
    save(this.blob(), this.name);
  }

  async upload() {
    const { progress } = this;
    this.uploadButton.disabled = true;
    progress.hidden = false;
    progress.value = 0;
    this.result.hidden = true;
    try {
      const path = `/uploads?kind=path&name=${encodeURIComponent(this.name)}`;
      const upload = await this.api.upload(path, this.blob(), (sent, all) => (progress.value = all > 0 ? sent / all : 0));
      this.uploaded(upload);
      this.say("The path is uploaded");
    } catch (error) {
      this.result.replaceChildren(el("p", { class: "cmv-error", role: "alert", text: `The upload failed: ${explain(error)}` }));
    }
    this.result.hidden = false;
    progress.hidden = true;
    this.buttons();
  }

  /** What to write into a manifest, ready to be copied. */
  uploaded(upload) {
    const reference = el("input", { type: "text", readonly: true, value: upload.reference, "aria-label": "Reference of the path", class: "cmv-name" });
    reference.addEventListener("focus", () => reference.select());
    const copy = button("Copy", async () => {
      try {
        await navigator.clipboard.writeText(upload.reference);
        copy.textContent = "Copied";
      } catch {
        // Without a secure context there is no clipboard: the text is selected for Ctrl+C.
        reference.focus();
      }
    });
    const name = this.name.replace(/\.csv$/, "");
    const manifest = `[[path]]\nname = ${JSON.stringify(name)}\nfile = ${JSON.stringify(upload.reference)}`;
    this.result.replaceChildren(el("div", { class: "cmv-row" }, reference, copy), el("pre", { text: manifest }));
  }
}
