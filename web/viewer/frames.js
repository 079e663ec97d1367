// Frames from the server: which to ask for next, which to keep, which requests to give
// up. Scrubbing asks for frames without truth, which cost the server little; where the
// slider rests, the truth is asked for too. Neighbours are fetched ahead.

const REST_MS = 250;
// A frame that is nearly here is shown on the way; older requests are given up.
const STALE_MS = 400;
const BUDGET_BYTES = 96 * 2 ** 20;
const MOST_FRAMES = 96;
const LEAST_FRAMES = 6;

export class FrameStore {
  /**
   * `load(n, truth, signal)` answers a parsed frame; `on.frame(n, frame)`,
   * `on.state("idle" | "loading" | "truth")`, `on.error(n, error)`, `on.rest(n)`.
   */
  constructor(count, load, on) {
    this.count = count;
    this.load = load;
    this.on = on;
    this.cache = new Map();
    this.bytes = 0;
    this.failed = new Set();
    this.main = null;
    this.ahead = null;
    this.target = -1;
    this.direction = 1;
    this.rested = false;
  }

  has(n) {
    return this.cache.has(n);
  }

  /** Shows frame `n` as soon as it is here. */
  want(n) {
    if (n !== this.target) {
      this.direction = n < this.target ? -1 : 1;
      this.target = n;
      this.rested = false;
      clearTimeout(this.timer);
      this.timer = setTimeout(() => {
        this.rested = true;
        this.on.rest(this.target);
        this.pump();
      }, REST_MS);
    }
    const frame = this.touch(n);
    if (frame) this.on.frame(n, frame);
    this.pump();
  }

  /** The frame with truth, for whoever looks for losses. Ends in an error as `load` does. */
  async judged(n, signal) {
    const known = this.cache.get(n);
    if (known?.truth) return known;
    const frame = await this.load(n, true, signal);
    this.keep(n, frame);
    return frame;
  }

  retry() {
    this.failed.clear();
    this.pump();
  }

  destroy() {
    clearTimeout(this.timer);
    this.main?.controller.abort();
    this.ahead?.controller.abort();
    this.destroyed = true;
    this.cache.clear();
  }

  touch(n) {
    const frame = this.cache.get(n);
    if (frame) {
      // A map keeps the order of insertion: the first is the one longest unused.
      this.cache.delete(n);
      this.cache.set(n, frame);
    }
    return frame;
  }

  keep(n, frame) {
    const before = this.cache.get(n);
    if (before?.truth && !frame.truth) return;
    if (before) this.bytes -= before.bytes;
    this.cache.delete(n);
    this.cache.set(n, frame);
    this.bytes += frame.bytes;
    for (const [key, old] of this.cache) {
      const full = this.bytes > BUDGET_BYTES || this.cache.size > MOST_FRAMES;
      if (!full || this.cache.size <= LEAST_FRAMES) break;
      if (key === this.target) continue;
      this.cache.delete(key);
      this.bytes -= old.bytes;
    }
  }

  /** Starts what is to be done next, if anything. */
  pump() {
    if (this.destroyed || this.target < 0) return;
    const have = this.cache.get(this.target);
    if (this.main && this.main.n !== this.target) {
      // A truth is long in coming; a plain frame on its way is worth waiting a moment for.
      const stale = this.main.truth || performance.now() - this.main.since > STALE_MS || have;
      if (stale) this.drop("main");
    }
    if (!this.main) {
      if (!have) this.start("main", this.target, false);
      else if (!have.truth && !have.asked && this.rested) this.start("main", this.target, true);
    }
    const state = !this.main ? "idle" : this.main.truth ? "truth" : "loading";
    if (state !== this.state) {
      this.state = state;
      this.on.state(state);
    }
    this.prefetch();
  }

  prefetch() {
    const wanted = [];
    for (const step of this.rested ? [1, -1, 2, -2] : [1, 2, 3, 4]) {
      const n = this.target + step * this.direction;
      if (n >= 0 && n < this.count) wanted.push(n);
    }
    if (this.ahead && !wanted.includes(this.ahead.n) && this.ahead.n !== this.target) this.drop("ahead");
    if (this.ahead || !this.cache.has(this.target)) return;
    const next = wanted.find((n) => !this.cache.has(n) && !this.failed.has(`${n} false`) && this.main?.n !== n);
    if (next !== undefined) this.start("ahead", next, false);
  }

  drop(slot) {
    this[slot].controller.abort();
    this[slot] = null;
  }

  start(slot, n, truth) {
    const key = `${n} ${truth}`;
    if (this.failed.has(key)) return;
    if (slot === "main" && this.ahead?.n === n && !truth) {
      // What was fetched ahead is now what is wanted.
      this.main = this.ahead;
      this.ahead = null;
      return;
    }
    const request = { n, truth, controller: new AbortController(), since: performance.now() };
    this[slot] = request;
    this.load(n, truth, request.controller.signal).then(
      (frame) => this.done(request, (main) => this.arrived(request, frame, main)),
      (error) =>
        this.done(request, () => {
          this.failed.add(key);
          if (n === this.target) this.on.error(n, error);
        }),
    );
  }

  done(request, act) {
    if (this.destroyed || request.controller.signal.aborted) return;
    const main = this.main === request;
    if (main) this.main = null;
    else if (this.ahead === request) this.ahead = null;
    else return;
    act(main);
    this.pump();
  }

  arrived(request, frame, main) {
    // A server that cannot tell is not asked again and again.
    frame.asked = request.truth;
    this.keep(request.n, frame);
    // On the way to another frame the one that came is better than none.
    const onTheWay = main && !request.truth && !this.cache.has(this.target);
    if (request.n === this.target || onTheWay) this.on.frame(request.n, this.cache.get(request.n));
  }
}
