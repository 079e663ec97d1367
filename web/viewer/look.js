// How things are drawn: colours of the page and choices of the reader, in the form that
// the renderer takes. One object, changed in place and read at every drawing.

import { LOST, SEEN, UNSEEN } from "./formats.js";
import { mix, pageColours, rgb, STATE_COLOURS } from "./palette.js";

export const UNSUBMITTED = { hidden: 0, ghost: 1, shown: 2 };

export function newLook(triangles) {
  const lost = rgb(STATE_COLOURS[LOST]);
  return {
    margin: [0, 0, 0],
    ground: [1, 1, 1],
    ink: [0, 0, 0],
    accent: new Float32Array([0, 0, 1, 1]),
    rim: new Float32Array([1, 1, 1, 1]),
    recordColour: rgb("#cc79a7"),
    seen: new Float32Array([...rgb(STATE_COLOURS[SEEN]), 0]),
    unseen: new Float32Array(rgb(STATE_COLOURS[UNSEEN])),
    lost: new Float32Array(lost),
    lostFill: new Float32Array([...lost, 0.55]),
    lostEdge: new Float32Array([...lost, 1]),
    pale: new Float32Array([0.6, 0.6, 0.6, 0.75]),
    // Many ghosts lie behind each other: the more triangles, the less of each.
    ghostAlpha: triangles > 50000 ? 0.06 : 0.12,
    show: (1 << UNSEEN) | (1 << SEEN) | (1 << LOST),
    unsubmitted: { left: UNSUBMITTED.hidden, right: UNSUBMITTED.ghost },
    boxesInCamera: false,
    faces: false,
    through: true,
    backs: false,
    cut: 1e30,
    reach: 0.25,
  };
}

/** Takes over the page's colours, light or dark. */
export function applyTheme(look, root) {
  const page = pageColours(root);
  look.ground = mix(page.paper, page.ink, 0.05);
  look.margin = mix(page.paper, page.ink, 0.14);
  look.ink = page.ink;
  for (let k = 0; k < 3; k++) {
    look.accent[k] = page.accent[k];
    look.pale[k] = mix(page.paper, page.ink, 0.42)[k];
  }
}

/** Calls `act` whenever the page may have changed its theme; answers how to stop that. */
export function watchTheme(act) {
  const media = matchMedia("(prefers-color-scheme: dark)");
  const observer = new MutationObserver(act);
  media.addEventListener("change", act);
  observer.observe(document.documentElement, { attributes: true, attributeFilter: ["class", "style", "data-theme"] });
  return () => {
    media.removeEventListener("change", act);
    observer.disconnect();
  };
}
