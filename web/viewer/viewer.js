// The frame viewer and path recorder: what a method did in one frame of a run, or an
// uploaded scene to fly through. `mount` puts it into an element of a page; loading goes
// on behind, and what fails is said in the element.

import { DepthPicture } from "./depth.js";
import { el, explain, number, save } from "./dom.js";
import { LOST, NOT_SUBMITTED, parseFrame, parseMesh, parseNodes, SEEN, UNSEEN } from "./formats.js";
import { FrameStore } from "./frames.js";
import { listen } from "./keyboard.js";
import { applyTheme, newLook, watchTheme } from "./look.js";
import { clamp } from "./math.js";
import { keySection, nodeSection, triangleSection, viewSection } from "./panel.js";
import { Recorder } from "./recorder.js";
import { Stage } from "./stage.js";
import { Timeline } from "./timeline.js";

// Few numbers: the strip is for finding frames, the run's page for reading them.
const SERIES = "triangles,cull_ns";
const segment = (text) => encodeURIComponent(text).replace(/%40/g, "@");

/**
 * `options`: `{kind: "run", study, run, frame, api}` or `{kind: "scene", upload, api}`
 * (`upload` is an id or the Upload itself). Answers `{destroy()}`.
 */
export async function mount(container, options) {
  stylesheet();
  const viewer = new Viewer(container, options);
  viewer.start().catch((error) => viewer.fail(error));
  return { destroy: () => viewer.destroy() };
}

function stylesheet() {
  const href = new URL("./viewer.css", import.meta.url).href;
  if ([...document.styleSheets].some((sheet) => sheet.href === href)) return;
  if (document.querySelector('link[data-viewer="cullmark"]')) return;
  document.head.append(el("link", { rel: "stylesheet", href, "data-viewer": "cullmark" }));
}

function lensOf(camera, size) {
  if (!camera) return null;
  const degrees = camera.fov_y_deg;
  const height = camera.ortho_height_m ?? null;
  const near = camera.near_m ?? 0.1;
  // Parallel rays need an end of depth; no scene reaches beyond this one.
  const far = camera.far_m ?? (height === null ? null : near + 8 * size);
  return { fovY: ((degrees ?? 60) * Math.PI) / 180, height, near, far };
}

/** Lost triangles of a judged frame as the run's record has them; undefined if it does not say. */
function lossesOf(entry) {
  const size = (x) => (Array.isArray(x) ? x.length : typeof x === "number" ? x : undefined);
  return size(entry.lost) ?? size(entry.false_culls) ?? size(entry.false_cull_samples);
}

class Viewer {
  constructor(container, options) {
    this.options = options;
    this.api = options.api;
    this.abort = new AbortController();
    const of = options.kind === "run"
      ? `/studies/${segment(options.study)}/runs/${segment(options.run)}`
      : `/uploads/${segment(options.upload?.id ?? options.upload)}`;
    this.paths = { run: of, view: `${of}/view` };
    this.status = el("p", { class: "cmv-status", role: "status", "aria-live": "polite" });
    this.busy = el("span", { class: "cmv-busy" });
    this.errors = el("div", { class: "cmv-errors", role: "alert" });
    this.body = el("div", { class: "cmv-body" });
    this.root = el("section", { class: "cmv", "aria-label": options.kind === "run" ? "Frame viewer" : "Scene viewer" },
      this.body, el("div", { class: "cmv-foot" }, this.status, this.busy), this.errors);
    container.append(this.root);
  }

  async start() {
    const { api, paths } = this;
    const signal = this.abort.signal;
    this.busy.textContent = "loading the scene …";
    const view = await api.json(paths.view, { signal });
    const [meshBytes, nodesBytes] = await Promise.all([
      api.binary(`${paths.view}/mesh`, { signal }),
      view.nodes > 0 ? api.binary(`${paths.view}/nodes`, { signal }) : null,
    ]);
    if (signal.aborted) return;
    this.view = view;
    this.mesh = parseMesh(meshBytes);
    this.nodes = nodesBytes ? parseNodes(nodesBytes) : { count: 0, floats: new Float32Array(0), integers: new Uint32Array(0), deepest: 0 };
    this.build();
    this.busy.textContent = "";
    if (this.frames > 0) this.begin();
    else this.still();
  }

  build() {
    const { view, mesh, nodes } = this;
    const lo = view.lo ?? [0, 0, 0];
    const hi = view.hi ?? [1, 1, 1];
    const poses = view.poses ?? [];
    // A frame without a pose could not be drawn.
    this.frames = this.options.kind === "run" ? Math.min(view.frames ?? poses.length, poses.length) : 0;
    const lens = lensOf(view.camera, Math.hypot(...hi.map((h, k) => h - lo[k])) + 1);
    const measured = this.frames > 0 && lens !== null;
    this.look = newLook(mesh.triangles);
    // Nothing was submitted in a scene without frames, so nothing is pale in it.
    if (!measured) this.look.pale[3] = 0;
    this.stage = new Stage({ lo, hi, lens, aspect: view.camera?.aspect ?? 1.5, poses, measured }, this.look, {
      lost: () => this.say("The graphics card was taken away; waiting for it to come back …"),
      restored: () => this.say("The graphics card is back"),
      mode: () => this.viewPanel?.update(),
      layout: (layout) => this.layout(layout),
    });
    this.recorder = new Recorder(this.stage, view, this.api, (text) => this.say(text));
    const changed = () => this.stage.invalidate();
    const viewPanel = viewSection(this.stage, this.look, {
      changed,
      layout: (layout) => this.layout(layout),
      follow: (follow) => this.stage.setFollow(follow),
      fit: () => this.stage.fit(),
      screenshot: () => this.screenshot(),
      full: () => (document.fullscreenElement ? document.exitFullscreen() : this.root.requestFullscreen?.()),
    });
    this.viewPanel = viewPanel;
    const side = el("div", { class: "cmv-side" });
    const main = el("div", { class: "cmv-main" }, viewPanel.bar, this.stage.node);
    if (this.frames > 0) {
      this.trianglePanel = triangleSection(this.look, { changed });
      side.append(this.trianglePanel.node);
      if (nodes.count > 0) {
        this.nodePanel = nodeSection(nodes, view.tests ?? [], this.look, { changed, boxes: () => this.boxes() });
        side.append(this.nodePanel.node);
      }
      if (view.depth) {
        const load = (n, signal) => this.api.binary(`${this.paths.view}/frames/${n}/depth`, { signal });
        this.depth = new DepthPicture(this.stage.leftPane, load);
        side.append(this.depth.node);
      }
      this.timeline = new Timeline(this.frames, view.judged ?? [], {
        go: (n) => this.go(n),
        play: (playing) => this.play(playing),
        loss: () => this.nextLoss(),
      });
      main.append(this.timeline.node);
    }
    side.append(viewPanel.node, this.recorder.node, keySection(this.frames > 0));
    // Without frames recording is what one comes for.
    if (this.frames === 0) this.recorder.node.open = true;
    this.body.replaceChildren(main, side);
    this.stage.renderer.setMesh(mesh);
    this.stage.renderer.boxes.setNodes(nodes);
    this.unwatch = watchTheme(() => this.theme());
    this.theme();
    listen(this, this.abort.signal);
    // The style sheet may come later than the scene, and colours with it.
    for (const link of document.querySelectorAll("link[data-viewer]")) link.addEventListener("load", () => this.theme());
  }

  theme() {
    applyTheme(this.look, this.root);
    this.timeline?.paint();
    this.stage.invalidate();
  }

  layout(layout) {
    this.stage.setLayout(layout);
    this.viewPanel.update();
  }

  /** A scene without frames: nothing more to come. */
  still() {
    const { triangles } = this.mesh;
    this.say(triangles > 0 ? `${number(triangles)} triangles` : "The scene has no triangles");
    this.stage.draw();
    window.__viewer = { ready: true, frame: null, counts: { triangles }, stage: this.stage, recorder: this.recorder };
  }

  begin() {
    const load = async (n, truth, signal) => {
      const bytes = await this.api.binary(`${this.paths.view}/frames/${n}?truth=${truth}`, { signal });
      return parseFrame(bytes, this.mesh.triangles, this.nodes.count);
    };
    this.store = new FrameStore(this.frames, load, {
      frame: (n, frame) => this.show(n, frame),
      state: (state) => {
        this.busy.textContent = { idle: "", loading: "loading the frame …", truth: "computing visibility …" }[state];
      },
      error: (n, error) => this.frameFailed(n, error),
      rest: (n) => this.address(n),
    });
    this.numbers();
    const asked = this.options.frame ?? new URL(location.href).searchParams.get("frame");
    this.timeline.go(clamp(Math.round(Number(asked)) || 0, 0, this.frames - 1));
  }

  /** Numbers of all frames and of those that were judged: the viewer does without if need be. */
  async numbers() {
    const { api, paths, timeline } = this;
    const options = { signal: this.abort.signal };
    const quietly = (request) => request.catch(() => null);
    const [series, run] = await Promise.all([
      quietly(api.json(`${paths.run}/series?names=${SERIES}`, options)),
      quietly(api.json(paths.run, options)),
    ]);
    if (this.abort.signal.aborted) return;
    // The server may answer in another order, and with fewer.
    const order = SERIES.split(",");
    const known = (series?.series ?? []).filter((s) => order.includes(s.name));
    timeline.setSeries(known.sort((a, b) => order.indexOf(a.name) - order.indexOf(b.name)));
    for (const entry of run?.judged_frames ?? []) {
      const lost = lossesOf(entry);
      if (lost !== undefined) timeline.setLoss(entry.frame, lost);
    }
  }

  go(n) {
    this.store.want(n);
  }

  show(n, frame) {
    const start = performance.now();
    const { stage } = this;
    this.shown = n;
    this.depth?.show(n);
    this.frame = frame;
    stage.setMeasured(n);
    stage.renderer.setFrame(frame);
    this.boxes();
    this.uploadMs = performance.now() - start;
    this.trianglePanel.update(frame, this.mesh.triangles);
    this.nodePanel?.update(frame);
    this.errors.replaceChildren();
    if (frame.truth) this.timeline.setLoss(n, frame.counts[LOST]);
    this.summary();
    // On the way to the truth nothing is complete yet.
    if (frame.truth || frame.asked) this.complete();
  }

  boxes() {
    if (!this.nodePanel || !this.frame) return;
    const { shown, depths } = this.nodePanel;
    this.stage.renderer.boxes.choose(this.frame.nodes, shown, depths.least, depths.most);
    this.stage.invalidate();
  }

  /** In words, for everybody and for screen readers; not at every frame of a film. */
  summary() {
    const { frame, shown } = this;
    const submitted = frame.counts[UNSEEN] + frame.counts[SEEN];
    const truth = frame.truth
      ? `, ${number(frame.counts[SEEN] + frame.counts[LOST])} visible, ${number(frame.counts[LOST])} lost`
      : "";
    const text = `frame ${shown} of ${number(this.frames)}: ${number(submitted)} submitted${truth}`;
    this.stage.canvas.setAttribute("aria-label", `The scene in 3D, ${text}`);
    clearTimeout(this.spoken);
    this.spoken = setTimeout(() => this.say(text), this.timeline.playing ? 1000 : frame.truth ? 0 : 200);
  }

  /** For tests in a browser: what is shown once nothing more is to come. Unknown is null. */
  complete() {
    const { counts, truth } = this.frame;
    const known = (n) => (truth ? n : null);
    window.__viewer = {
      ready: true,
      frame: this.shown,
      truth,
      counts: {
        triangles: this.mesh.triangles,
        not_submitted: counts[NOT_SUBMITTED],
        submitted: counts[UNSEEN] + counts[SEEN],
        over_submitted: known(counts[UNSEEN]),
        visible: known(counts[SEEN] + counts[LOST]),
        lost: known(counts[LOST]),
      },
      timings: { upload_ms: this.uploadMs },
      stage: this.stage,
      recorder: this.recorder,
    };
  }

  say(text) {
    this.status.textContent = text;
  }

  /** The address names the frame, so that it can be sent to somebody. */
  // Replaced, not pushed: a hundred frames must not be a hundred steps back.
  address(n) {
    const url = new URL(location.href);
    url.searchParams.set("frame", n);
    try {
      history.replaceState(history.state, "", url);
    } catch {
      // Browsers limit how often; the next rest brings it up to date.
    }
  }

  play(playing) {
    const { stage, timeline } = this;
    if (this.player) stage.tickers.delete(this.player);
    this.player = null;
    if (!playing) return;
    let due = 0;
    this.player = (now) => {
      // Frames that are late are waited for, not left out.
      if (now < due || this.shown !== timeline.current) return true;
      due = Math.max(due + 1000 / timeline.pace, now - 100);
      if (timeline.current >= this.frames - 1) timeline.play(false);
      else timeline.go(timeline.current + 1);
      return true;
    };
    stage.tickers.add(this.player);
    stage.invalidate();
  }

  /** Known losses first hand; judged frames that nobody has looked at yet are computed. */
  async nextLoss() {
    const { timeline } = this;
    const { judged, losses, current } = timeline;
    // A second press while one search is under way would only ask twice.
    if (this.searching || judged.length === 0) return;
    this.searching = true;
    timeline.lossButton.disabled = true;
    const order = [...judged.filter((n) => n > current), ...judged.filter((n) => n <= current)];
    try {
      for (const n of order) {
        if (!losses.has(n)) {
          this.say(`computing what is visible in frame ${n} …`);
          const frame = await this.store.judged(n, this.abort.signal);
          timeline.setLoss(n, frame.counts[LOST]);
        }
        if (losses.get(n) > 0 && n !== current) return timeline.go(n);
      }
      const here = losses.get(current) > 0;
      this.say(here ? "no other judged frame has a loss" : `none of the ${judged.length} judged frames has a loss`);
    } catch (error) {
      if (!this.abort.signal.aborted) this.frameFailed(current, error);
    } finally {
      this.searching = false;
      timeline.lossButton.disabled = false;
    }
  }

  frameFailed(n, error) {
    // A film stops at the first frame that is missing.
    if (this.player) this.timeline.play(false);
    const again = el("button", { type: "button", text: "Try again", onclick: () => {
      this.errors.replaceChildren();
      this.store.retry();
    } });
    this.errors.replaceChildren(el("p", { class: "cmv-error", text: `Frame ${n}: ${explain(error)}` }), again);
  }

  async screenshot() {
    const { options } = this;
    const of = options.kind === "run" ? `${options.study}-run-${options.run}-frame-${this.shown}` : "scene";
    try {
      save(await this.stage.screenshot(), `cullmark-${of}.png`.replace(/[^\w.@-]+/g, "-"));
    } catch (error) {
      this.say(explain(error));
    }
  }

  fail(error) {
    if (this.abort.signal.aborted) return;
    this.busy.textContent = "";
    // Nothing is shown yet that could be lost by beginning anew.
    const again = el("button", { type: "button", text: "Try again", onclick: () => {
      this.errors.replaceChildren();
      this.start().catch((next) => this.fail(next));
    } });
    this.errors.replaceChildren(el("p", { class: "cmv-error", text: explain(error) }), this.stage ? "" : again);
  }

  destroy() {
    this.abort.abort();
    clearTimeout(this.spoken);
    this.store?.destroy();
    this.timeline?.destroy();
    this.depth?.destroy();
    this.unwatch?.();
    this.stage?.destroy();
    this.root.remove();
    delete window.__viewer;
  }
}
