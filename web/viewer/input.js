// Pointers on a pane: one finger or button drags, two fingers pinch and shift, the wheel
// zooms. What that means is up to the pane's camera.

/**
 * Handlers: `drag(dx, dy, second)` where `second` is the right or middle button or shift;
 * `pinch(factor, dx, dy)`; `wheel(steps, x, y)` with x, y from -1 to 1 upwards.
 */
export function pointers(pane, handlers, signal) {
  const down = new Map();
  const last = { x: 0, y: 0, span: 0 };

  const centre = () => {
    let [x, y, span] = [0, 0, 0];
    const all = [...down.values()];
    for (const p of all) {
      x += p.x / all.length;
      y += p.y / all.length;
    }
    if (all.length > 1) span = Math.hypot(all[0].x - all[1].x, all[0].y - all[1].y);
    return { x, y, span };
  };

  const own = (event) => event.target === pane;

  pane.addEventListener(
    "pointerdown",
    (event) => {
      if (!own(event)) return;
      pane.setPointerCapture(event.pointerId);
      pane.focus({ preventScroll: true });
      down.set(event.pointerId, { x: event.clientX, y: event.clientY, second: event.button > 0 });
      Object.assign(last, centre());
      event.preventDefault();
    },
    { signal },
  );

  pane.addEventListener(
    "pointermove",
    (event) => {
      const p = down.get(event.pointerId);
      if (!p) return;
      p.x = event.clientX;
      p.y = event.clientY;
      const now = centre();
      const [dx, dy] = [now.x - last.x, now.y - last.y];
      if (down.size === 1) handlers.drag(dx, dy, p.second || event.shiftKey);
      else handlers.pinch(last.span > 0 ? now.span / last.span : 1, dx, dy);
      Object.assign(last, now);
    },
    { signal },
  );

  const up = (event) => {
    if (down.delete(event.pointerId)) Object.assign(last, centre());
  };
  pane.addEventListener("pointerup", up, { signal });
  pane.addEventListener("pointercancel", up, { signal });
  pane.addEventListener("contextmenu", (event) => own(event) && event.preventDefault(), { signal });

  pane.addEventListener(
    "wheel",
    (event) => {
      // Only where the pane has been entered on purpose: otherwise the page must scroll.
      if (!own(event) || !(pane === document.activeElement || event.ctrlKey)) return;
      event.preventDefault();
      const box = pane.getBoundingClientRect();
      const pixels = event.deltaY * (event.deltaMode === 1 ? 16 : event.deltaMode === 2 ? 400 : 1);
      const x = (2 * (event.clientX - box.left)) / box.width - 1;
      const y = 1 - (2 * (event.clientY - box.top)) / box.height;
      handlers.wheel(pixels / 100, x, y);
    },
    { signal, passive: false },
  );
}

/** Keys that are held, by `code`, so that WASD lies where it lies on every keyboard. */
export class Keys {
  constructor() {
    this.codes = new Set();
  }
  has(code) {
    return this.codes.has(code);
  }
  press(code, shift) {
    if (code) this.codes.add(code);
    this.shift(shift);
  }
  release(event) {
    this.codes.delete(event.code);
    this.shift(event.shiftKey);
  }
  shift(down) {
    if (down) this.codes.add("Shift");
    else this.codes.delete("Shift");
  }
  clear() {
    this.codes.clear();
  }
}

export const MOVES = new Set(["KeyW", "KeyA", "KeyS", "KeyD", "KeyQ", "KeyE", "KeyI", "KeyJ", "KeyK", "KeyL"]);
