// Keyboard shortcuts of the whole page: `/`, `?` and `g` followed by a letter.

import { show } from "/parts/dialog.js";
import { h } from "/parts/dom.js";

// `g` and one of these, as in many tools.
const PLACES = {
  s: ["/", "studies"],
  n: ["/submit", "new study"],
  c: ["/compare", "compare"],
  u: ["/scenes", "scenes and paths"],
  m: ["/machine", "machine"],
};
const CHORD_MS = 1500;

// Where keys are text.
const typing = (node) =>
  node.matches?.("input, textarea, select, [contenteditable]") &&
  !node.matches("[type=checkbox], [type=radio]");

/** Listens on the document; a page’s own keys come first, since they stop the event. */
export function startKeys(navigate) {
  let gAt = 0;
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.defaultPrevented) return;
    // Inside text and dialogs keys mean what they say.
    if (typing(event.target) || document.querySelector("dialog[open]")) return;
    const chord = Date.now() - gAt < CHORD_MS;
    gAt = 0;
    if (chord && PLACES[event.key]) {
      event.preventDefault();
      navigate(PLACES[event.key][0]);
    } else if (event.key === "g") gAt = Date.now();
    else if (event.key === "?") showHelp();
    else if (event.key === "/") {
      const filter = document.querySelector("main [data-filter]");
      if (!filter) return;
      event.preventDefault();
      filter.focus();
      filter.select?.();
    }
  });
}

const row = (keys, what) =>
  h(
    "tr",
    null,
    h(
      "th",
      { scope: "row" },
      keys.map((k, i) => [i ? " " : "", h("kbd", null, k)]),
    ),
    h("td", null, what),
  );

/** All keys in one table. */
export function showHelp() {
  show(
    "Keyboard",
    h(
      "table",
      { class: "plain keys" },
      h("caption", { class: "offscreen" }, "Keyboard shortcuts"),
      h(
        "tbody",
        null,
        row(["/"], "Go to the filter of the page"),
        Object.entries(PLACES).map(([key, [, name]]) => row(["g", key], `Go to ${name}`)),
        row(["?"], "This help"),
        row(["←", "→", "↑", "↓"], "In a matrix, a front or a chart: move to the next cell, point or frame"),
        row(["Enter"], "Open the run of that cell or point"),
        row(["+", "−"], "In a matrix or a chart of frames: zoom; 0 shows everything"),
        row(["Esc", "Tab"], "In the manifest: leave the editor (Tab alone indents)"),
        row(["Ctrl", "Enter"], "In the manifest: submit"),
      ),
    ),
  );
}
