// The picture: one canvas with up to two panes over it, their cameras and pointers, and
// the loop that draws when something changed and at no other time.

import { FlyCamera, OrbitCamera } from "./camera.js";
import { el, select } from "./dom.js";
import { context } from "./gl.js";
import { Keys, pointers } from "./input.js";
import { clamp, viewProjection } from "./math.js";
import { frustumData, frustumSegments, pathSegments } from "./plan.js";
import { Renderer } from "./renderer.js";

// For scenes that no run has a camera for.
const DEFAULT_FOV = Math.PI / 3;
// Higher than any scene: nothing is cut off. Infinity is no number for a shader.
const NOWHERE = 1e30;
const PANS = ["KeyW", "KeyA", "KeyS", "KeyD"];
// A tab that comes back after a minute must not fly on for a minute.
const LONGEST_STEP_S = 0.1;
// Beyond two pixels a point nobody sees a difference, but the GPU has twice the work.
const MOST_PIXELS_A_POINT = 2;

const newPane = () => ({
  x: 0, y: 0, width: 0, height: 0, ratio: 1, aspect: 1, pose: null, matrix: new Float32Array(16),
  cut: NOWHERE, unsubmitted: 0, boxes: false, backs: false, lines: [], marked: null,
});
const line = (name, width) => ({ name, width, split: 0, before: new Float32Array(4), after: new Float32Array(4) });
const paint = (target, colour, alpha) => {
  for (let k = 0; k < 3; k++) target[k] = colour[k];
  target[3] = alpha;
};

export class Stage {
  /** `scene`: `{lo, hi, lens, aspect, poses, measured}`; `on`: `{lost(), restored(), mode()}`. */
  constructor(scene, look, on) {
    this.scene = scene;
    this.look = look;
    this.on = on;
    this.keys = new Keys();
    this.tickers = new Set();
    this.abort = new AbortController();
    this.left = newPane();
    this.right = newPane();
    this.panes = [];
    this.layout = "both";
    this.leftMode = scene.measured ? "measured" : "fly";
    this.followed = false;
    this.active = "left";
    this.timings = { draw: 0 };
    const size = Math.max(Math.hypot(...scene.hi.map((h, k) => h - scene.lo[k])), 1e-3);
    this.size = size;
    // Nobody can fly through a telescope, which a measured camera may be.
    const fovY = clamp(scene.lens?.fovY ?? DEFAULT_FOV, 0.5, 1.75);
    const near = clamp(size * 1e-5, 0.01, 1);
    this.fly = new FlyCamera({ fovY, height: null, near, far: null }, clamp(size / 25, 1.5, 60));
    this.orbit = new OrbitCamera(scene.lo, scene.hi);
    this.measured = { eye: [0, 0, 0], forward: [1, 0, 0], up: [0, 0, 1] };
    if (scene.poses.length) this.setMeasured(0);
    this.fly.setPose(scene.poses.length ? this.measured : this.orbit.pose);
    this.frustum = frustumData();
    this.flyFrustum = frustumData();
    this.lines = { path: line("path", 2.5), frustum: line("frustum", 2), fly: line("fly", 1.5), record: line("record", 3) };
    this.build();
  }

  build() {
    const signal = this.abort.signal;
    this.canvas = el("canvas", { class: "cmv-canvas", role: "img", "aria-label": "The scene in 3D" });
    const pane = (name, label) =>
      el("div", {
        class: `cmv-pane cmv-pane-${name}`, tabindex: "0", role: "application", "aria-label": label,
        onfocus: () => (this.active = name),
      });
    this.leftPane = pane("left", "Camera: drag or I J K L to look, W A S D Q E to fly");
    this.rightPane = pane("right", "Bird's eye: drag to turn, right button to move, wheel or Q E to zoom");
    const modes = this.scene.measured ? [["measured", "Measured camera"], ["fly", "Free flight"]] : [["fly", "Free flight"]];
    this.leftSelect = select("What the left view shows", modes, this.leftMode, (m) => this.setLeftMode(m));
    this.rightSelect = select("How the bird's eye looks", [["orbit", "Bird's eye"], ["plan", "Plan, straight down"]], "orbit", (m) => {
      this.orbit.setPlan(m === "plan");
      this.orbit.fit(this.right.aspect);
      this.invalidate();
    });
    this.leftPane.append(this.leftSelect);
    this.rightPane.append(this.rightSelect);
    this.node = el("div", { class: "cmv-stage" }, this.canvas, this.leftPane, this.rightPane);
    const gl = context(this.canvas);
    if (!gl) throw new Error("This browser offers no WebGL2, which the viewer draws with");
    this.renderer = new Renderer(gl);
    // Without preventDefault the browser never gives the context back.
    this.canvas.addEventListener("webglcontextlost", (event) => {
      event.preventDefault();
      this.on.lost();
    }, { signal });
    this.canvas.addEventListener("webglcontextrestored", () => {
      this.renderer.build();
      this.on.restored();
      this.invalidate();
    }, { signal });
    const path = pathSegments(this.scene.poses);
    this.renderer.setLines("path", path.data, path.count);
    this.renderer.setLines("record", new Float32Array(6), 0);
    this.steer(signal);
    this.resizer = new ResizeObserver(() => this.resize());
    this.resizer.observe(this.node);
  }

  steer(signal) {
    const touch = (act) => (...values) => {
      act(...values);
      this.invalidate();
    };
    pointers(this.leftPane, {
      drag: touch((dx, dy, second) => {
        this.takeOff();
        // Shifting goes with the speed of flight, which the reader has chosen for the scene's size.
        const metres = this.fly.speed * 0.004;
        if (second) this.fly.move(0, -dx * metres, dy * metres);
        else this.fly.look(dx, dy, this.left.height / this.left.ratio);
      }),
      pinch: touch((factor, dx, dy) => {
        this.takeOff();
        const metres = this.fly.speed * 0.006;
        this.fly.move(Math.log(factor) * this.fly.speed * 1.5, -dx * metres, dy * metres);
      }),
      wheel: touch((steps) => {
        this.takeOff();
        this.fly.move(-steps * this.fly.speed * 0.15, 0, 0);
      }),
    }, signal);
    pointers(this.rightPane, {
      drag: touch((dx, dy, second) => {
        // A plan has nothing to turn to: there the plain drag moves.
        const pan = this.orbit.plan ? !second : second;
        if (pan) this.pan(dx, dy);
        else this.orbit.orbit(dx, this.orbit.plan ? 0 : dy);
      }),
      pinch: touch((factor, dx, dy) => {
        this.orbit.zoom(1 / factor);
        this.pan(dx, dy);
      }),
      wheel: touch((steps, x, y) => this.orbit.zoom(Math.exp(steps * 0.18), x, y, this.right.aspect)),
    }, signal);
  }

  pan(dx, dy) {
    // Who moves the view wants it to stay there.
    this.setFollow(false);
    this.orbit.pan(dx, dy, this.right.height / this.right.ratio);
  }

  /** Steering the measured camera means to leave it. */
  takeOff() {
    if (this.leftMode !== "fly") this.setLeftMode("fly");
  }

  setLeftMode(mode) {
    // Flight begins where the measured camera stands.
    if (mode === "fly" && this.leftMode !== "fly") this.fly.setPose(this.measured);
    this.leftMode = mode;
    this.leftSelect.value = mode;
    this.resize();
    this.on.mode();
  }

  setLayout(layout) {
    this.layout = layout;
    this.leftPane.hidden = layout === "right";
    this.rightPane.hidden = layout === "left";
    // Keys go to the pane that is left.
    this.active = layout === "right" ? "right" : "left";
    this.resize();
  }

  setFollow(follow) {
    if (this.followed === follow) return;
    this.followed = follow;
    this.on.mode();
    this.invalidate();
  }

  fit() {
    this.orbit.fit(this.right.aspect);
    this.invalidate();
  }

  setMeasured(n) {
    const p = this.scene.poses[n];
    if (!p) return;
    this.frame = n;
    for (let k = 0; k < 3; k++) {
      this.measured.eye[k] = p[k];
      this.measured.forward[k] = p[3 + k];
      this.measured.up[k] = p[6 + k];
    }
    this.invalidate();
  }

  /** Sizes in device pixels; the measured camera keeps its aspect between bars. */
  resize() {
    const { canvas, node } = this;
    const ratio = Math.min(devicePixelRatio || 1, MOST_PIXELS_A_POINT);
    const width = Math.max(1, Math.round(node.clientWidth * ratio));
    const height = Math.max(1, Math.round(node.clientHeight * ratio));
    if (canvas.width !== width) canvas.width = width;
    if (canvas.height !== height) canvas.height = height;
    const both = this.layout === "both";
    // Below each other where there is no room for two.
    const stacked = both && node.clientWidth < 1.1 * node.clientHeight;
    node.classList.toggle("cmv-stacked", stacked);
    node.classList.toggle("cmv-both", both);
    const gap = Math.round(2 * ratio);
    const half = (all) => Math.floor((all - gap) / 2);
    const place = (pane, x, y, w, h, aspect) => {
      const inner = aspect ? Math.min(w, h * aspect) : w;
      const tall = aspect ? inner / aspect : h;
      pane.width = Math.round(inner);
      pane.height = Math.round(tall);
      pane.x = Math.round(x + (w - inner) / 2);
      pane.y = Math.round(y + (h - tall) / 2);
      pane.ratio = ratio;
      pane.aspect = pane.width / Math.max(pane.height, 1);
    };
    const aspect = this.leftMode === "measured" ? this.scene.aspect : 0;
    const w = both && !stacked ? half(width) : width;
    const h = stacked ? half(height) : height;
    place(this.left, 0, height - h, w, h, aspect);
    place(this.right, width - w, 0, w, h, 0);
    this.panes = this.layout === "left" ? [this.left] : this.layout === "right" ? [this.right] : [this.left, this.right];
    // Only now is it known how wide the pane is; later sizes leave the view alone.
    if (!this.fitted && width > 1) {
      this.fitted = true;
      this.orbit.fit(this.right.aspect);
    }
    // At once: the canvas was cleared, and waiting would show that.
    this.draw();
  }

  invalidate() {
    this.dirty = true;
    this.schedule();
  }

  schedule() {
    if (this.request || this.destroyed) return;
    this.request = requestAnimationFrame((now) => this.loop(now));
  }

  /** Goes on while keys are held or a ticker answers true; that alone draws nothing. */
  loop(now) {
    this.request = 0;
    const seconds = Math.min((now - (this.before ?? now)) / 1000, LONGEST_STEP_S);
    let busy = this.steerByKeys(seconds);
    if (busy) this.dirty = true;
    for (const ticker of this.tickers) busy = ticker(now, seconds) || busy;
    if (this.dirty) this.draw();
    // After a rest the next step starts at 0 s, not at the length of the rest.
    this.before = busy ? now : undefined;
    if (busy) this.schedule();
  }

  steerByKeys(seconds) {
    // Shift alone moves nothing.
    if (this.keys.codes.size === (this.keys.has("Shift") ? 1 : 0)) return false;
    if (this.active === "right") {
      this.orbit.step(this.keys, seconds);
      if (PANS.some((code) => this.keys.has(code))) this.setFollow(false);
    } else {
      this.takeOff();
      this.fly.step(this.keys, seconds);
    }
    // Also in the first frame of a press, whose step is 0 s long.
    return true;
  }

  /** The pose of the left view, which is also what is recorded. */
  get pose() {
    return this.leftMode === "fly" ? this.fly.pose : this.measured;
  }

  prepare() {
    const { left, right, look, lines, scene, renderer } = this;
    const flying = this.leftMode === "fly";
    if (this.followed) this.orbit.follow(this.pose.eye);
    left.pose = this.pose;
    const lens = flying || !scene.lens ? this.fly.lens : scene.lens;
    viewProjection(left.matrix, left.pose, lens, left.aspect);
    right.pose = this.orbit.pose;
    viewProjection(right.matrix, right.pose, this.orbit.lens, right.aspect);
    left.unsubmitted = look.unsubmitted.left;
    right.unsubmitted = look.unsubmitted.right;
    left.boxes = look.boxesInCamera;
    right.boxes = true;
    left.backs = right.backs = look.backs;
    right.cut = look.cut;
    lines.path.split = this.frame ?? 0;
    paint(lines.path.before, look.accent, 1);
    paint(lines.path.after, look.accent, 0.55);
    paint(lines.frustum.after, look.ink, 1);
    paint(lines.fly.after, look.accent, 1);
    paint(lines.record.after, look.recordColour, 1);
    // The same arrays every time: drawing makes no garbage.
    left.lines.length = right.lines.length = 0;
    if (scene.measured) {
      const reach = look.reach * this.size;
      renderer.setLines("frustum", this.frustum, frustumSegments(this.frustum, this.measured, scene.lens, scene.aspect, reach));
      right.lines.push(lines.path, lines.frustum);
      if (flying) left.lines.push(lines.path, lines.frustum);
    }
    if (flying) {
      // A hidden left pane has no aspect of its own.
      const aspect = this.layout === "both" ? left.aspect : 1.5;
      renderer.setLines("fly", this.flyFrustum, frustumSegments(this.flyFrustum, this.fly.pose, this.fly.lens, aspect, 0.04 * this.size));
      right.lines.push(lines.fly);
      left.lines.push(lines.record);
    }
    right.lines.push(lines.record);
    right.marked = scene.measured ? this.measured.eye : this.fly.pose.eye;
    left.marked = null;
  }

  draw() {
    if (this.destroyed) return;
    this.dirty = false;
    const start = performance.now();
    this.prepare();
    this.renderer.draw(this.panes, this.look);
    this.timings.draw = performance.now() - start;
  }

  /** A PNG of what is shown. Drawn and read in one go: the buffer is not kept. */
  screenshot() {
    this.draw();
    return new Promise((resolve, reject) => {
      this.canvas.toBlob((blob) => (blob ? resolve(blob) : reject(new Error("The picture could not be encoded"))), "image/png");
    });
  }

  /** Milliseconds a drawing until the GPU is done with it, and of JavaScript alone. */
  measure(count = 10) {
    const { gl } = this.renderer;
    const pixel = new Uint8Array(4);
    const finish = () => gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
    this.draw();
    finish();
    const start = performance.now();
    let script = 0;
    for (let i = 0; i < count; i++) {
      this.draw();
      script += this.timings.draw;
      finish();
    }
    return { frame_ms: (performance.now() - start) / count, script_ms: script / count };
  }

  destroy() {
    this.destroyed = true;
    cancelAnimationFrame(this.request);
    this.abort.abort();
    this.resizer.disconnect();
    // Browsers allow few contexts: this one is given back now, not when the garbage is collected.
    this.renderer.gl.getExtension("WEBGL_lose_context")?.loseContext();
    this.node.remove();
  }
}
