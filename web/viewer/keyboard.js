// What keys do: flying while they are held, and shortcuts. Keys count while the focus is
// anywhere in the viewer, but never against the control that has it.

import { MOVES } from "./input.js";

// Without frames to step through, arrows look around.
const LOOK = { ArrowLeft: "KeyJ", ArrowRight: "KeyL", ArrowUp: "KeyI", ArrowDown: "KeyK" };

export function listen(viewer, signal) {
  const { keys } = viewer.stage;
  viewer.root.addEventListener("keydown", (event) => down(viewer, event), { signal });
  window.addEventListener("keyup", (event) => {
    keys.release(event);
    if (LOOK[event.code]) keys.codes.delete(LOOK[event.code]);
  }, { signal });
  window.addEventListener("blur", () => keys.clear(), { signal });
}

function down(viewer, event) {
  const { target, code } = event;
  if (target.matches('input[type="text"], input[type="number"], textarea, select')) return;
  if ((event.ctrlKey || event.metaKey) && code === "KeyZ") {
    event.preventDefault();
    viewer.recorder.undo();
    return;
  }
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  // What the focused control does with a key goes first, but for the slider of frames.
  const slides = target.matches('input[type="range"]:not(.cmv-scrub), input[type="radio"]');
  if (slides && /^(Arrow|Home|End|Page)/.test(code)) return;
  if (code === "Space" && target.matches("button, summary, input:not(.cmv-scrub)")) return;
  const move = MOVES.has(code) ? code : viewer.frames === 0 ? LOOK[code] : undefined;
  if (move || code.startsWith("Shift")) {
    viewer.stage.keys.press(move ?? "", event.shiftKey);
    viewer.stage.invalidate();
    if (move) event.preventDefault();
    return;
  }
  const act = shortcut(viewer, code, event.shiftKey ? 10 : 1);
  if (!act || (event.repeat && !code.startsWith("Arrow"))) return;
  event.preventDefault();
  act();
}

function shortcut(viewer, code, by) {
  const { timeline, stage, recorder } = viewer;
  const common = {
    KeyR: () => recorder.toggle(),
    KeyP: () => recorder.place(),
    KeyF: () => stage.fit(),
  };
  if (!timeline) return common[code];
  return {
    ...common,
    ArrowLeft: () => timeline.go(timeline.current - by),
    ArrowRight: () => timeline.go(timeline.current + by),
    Home: () => timeline.go(0),
    End: () => timeline.go(viewer.frames - 1),
    Space: () => timeline.play(!timeline.playing),
    KeyN: () => viewer.nextLoss(),
    KeyC: () => stage.setLeftMode(stage.leftMode === "fly" ? "measured" : "fly"),
  }[code];
}
