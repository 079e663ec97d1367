// The depth buffer of a walk that draws occluders, in a corner of the camera's pane: what
// hides in the frame that is shown. Asked for where the slider rests, for it costs a pass.

import { checkbox, el, explain } from "./dom.js";

const REST_MS = 200;

export class DepthPicture {
  /** `load(n, signal)` answers the bytes of a PNG; the picture goes into `pane`. */
  constructor(pane, load) {
    this.load = load;
    this.image = el("img", { class: "cmv-depth", alt: "", hidden: true });
    this.note = el("p", { class: "cmv-note", role: "status" });
    const box = checkbox("Show the depth buffer", false, (on) => this.turn(on));
    this.node = el("details", { class: "cmv-section", open: true }, el("summary", { text: "What hides" }), box.node,
      el("p", { class: "cmv-note", text: "Occluders that the walk had drawn by the end of the frame: near is bright, blue is nothing." }), this.note);
    pane.append(this.image);
  }

  turn(on) {
    this.on = on;
    this.image.hidden = true;
    this.note.textContent = "";
    this.loaded = null;
    this.show(this.frame);
  }

  /** The frame that is shown now. */
  show(n) {
    this.frame = n;
    clearTimeout(this.timer);
    this.abort?.abort();
    const shown = this.on && n !== undefined && n === this.loaded;
    // A picture of another frame would mislead.
    this.image.hidden = !shown;
    if (!this.on || n === undefined || shown) return;
    this.timer = setTimeout(() => this.fetch(n), REST_MS);
  }

  async fetch(n) {
    const abort = new AbortController();
    this.abort = abort;
    try {
      const bytes = await this.load(n, abort.signal);
      if (abort.signal.aborted) return;
      const before = this.image.src;
      this.image.src = URL.createObjectURL(new Blob([bytes], { type: "image/png" }));
      if (before) URL.revokeObjectURL(before);
      this.image.alt = `Depth buffer of frame ${n}`;
      this.image.hidden = false;
      this.note.textContent = "";
      this.loaded = n;
    } catch (error) {
      if (abort.signal.aborted) return;
      this.image.hidden = true;
      this.loaded = null;
      this.note.textContent = `Frame ${n}: ${explain(error)}`;
    }
  }

  destroy() {
    clearTimeout(this.timer);
    this.abort?.abort();
    if (this.image.src) URL.revokeObjectURL(this.image.src);
  }
}
