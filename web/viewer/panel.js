// The controls beside the picture: what is shown and how, and the legend, which is at
// the same time the table of the frame's numbers.

import { button, checkbox, el, number, percent, select, slider } from "./dom.js";
import { DRAWN, FIRST_CULLED, HIDDEN, LOST, NOT_REACHED, SEEN, UNSEEN, WENT_ON } from "./formats.js";
import { UNSUBMITTED } from "./look.js";
import { decisionColour, decisionName, STATE_COLOURS, STATE_HELP, STATE_NAMES } from "./palette.js";

const section = (title, ...children) =>
  el("details", { class: "cmv-section", open: true }, el("summary", { text: title }), ...children);

function swatch(colour) {
  const node = el("span", { class: "cmv-swatch", "aria-hidden": "true" });
  node.style.background = colour;
  return node;
}

/** Layout, camera and picture: `on` has `layout, follow, fit, screenshot, full, changed`. */
export function viewSection(stage, look, on) {
  const { lo, hi } = stage.scene;
  const group = el("fieldset", { class: "cmv-choices" }, el("legend", { text: "Views" }));
  // Radio buttons of one name on one page belong together, so every viewer has its own.
  const name = `cmv-layout-${Math.random().toString(36).slice(2)}`;
  for (const [key, text] of [["both", "Both"], ["left", "Camera"], ["right", "Bird's eye"]]) {
    const input = el("input", { type: "radio", name, value: key, checked: key === stage.layout, onchange: () => on.layout(key) });
    group.append(el("label", {}, input, el("span", { text })));
  }
  const follow = checkbox("Bird's eye follows the camera", stage.followed, (f) => on.follow(f));
  const backs = checkbox("Show backs of one-sided surfaces", look.backs, (b) => {
    look.backs = b;
    on.changed();
  });
  const steps = 200;
  const height = (s) => lo[2] + ((hi[2] - lo[2]) * s) / steps;
  const cut = slider("Bird's eye cuts off above", {
    min: 0, max: steps, step: 1, value: steps,
    say: (s) => (s >= steps ? "nothing" : `${(height(s) - lo[2]).toFixed(1)} m`),
  }, (s) => {
    look.cut = s >= steps ? 1e30 : height(s);
    on.changed();
  });
  // From walking slowly to crossing a city, each step the same factor.
  const log = (s) => 0.2 * Math.pow(1000, s / 100);
  const speed = slider("Speed of flight", {
    min: 0, max: 100, step: 1, value: Math.round((100 * Math.log(stage.fly.speed / 0.2)) / Math.log(1000)),
    say: (s) => `${log(s) < 10 ? log(s).toFixed(1) : Math.round(log(s))} m/s`,
  }, (s) => (stage.fly.speed = log(s)));
  const node = section("View", follow.node, backs.node, cut.node, speed.node);
  const bar = el("div", { class: "cmv-bar" }, group,
    button("Fit bird's eye", on.fit, { title: "Everything in the picture (F)" }),
    button("Save picture", on.screenshot, { title: "The picture as a PNG file" }),
    button("Full screen", on.full));
  const update = () => {
    follow.input.checked = stage.followed;
    for (const input of group.querySelectorAll("input")) input.checked = input.value === stage.layout;
  };
  return { node, bar, update };
}

/** Legend and numbers of the triangles. */
export function triangleSection(look, on) {
  const rows = [SEEN, UNSEEN, LOST, 0].map((state) => {
    const count = el("td", { class: "cmv-number", text: "–" });
    const share = el("td", { class: "cmv-number cmv-share" });
    const label = el("span", { text: STATE_NAMES[state] });
    let head = label;
    if (state !== 0) {
      const input = el("input", { type: "checkbox", checked: true, onchange: () => {
        look.show = input.checked ? look.show | (1 << state) : look.show & ~(1 << state);
        on.changed();
      } });
      head = el("label", {}, input, label);
    }
    const row = el("tr", { title: STATE_HELP[state], class: state === LOST ? "cmv-lost" : "" },
      el("td", {}, swatch(STATE_COLOURS[state])), el("th", { scope: "row" }, head), count, share);
    return { state, count, share, row };
  });
  const choices = Object.keys(UNSUBMITTED).map((k) => [k, k]);
  const choose = (side, label) =>
    el("label", { class: "cmv-inline" }, el("span", { text: label }),
      select(`Not submitted triangles, ${label}`, choices, choices[look.unsubmitted[side]][0], (v) => {
        look.unsubmitted[side] = UNSUBMITTED[v];
        on.changed();
      }));
  const materials = checkbox("Seen ones in the colours of their materials", true, (m) => {
    look.seen[3] = m ? 0 : 1;
    on.changed();
  });
  const total = el("p", { class: "cmv-note" });
  const node = section("Triangles", el("table", { class: "cmv-legend" }, el("tbody", {}, ...rows.map((r) => r.row))), total,
    materials.node, el("div", { class: "cmv-note", text: "Not submitted ones are" }),
    el("div", { class: "cmv-row" }, choose("left", "in the camera"), choose("right", "from above")));
  const update = (frame, triangles) => {
    for (const { state, count, share } of rows) {
      // Without truth only what was not submitted is known; a dash is not a zero.
      const known = frame && (frame.truth || state === 0);
      count.textContent = known ? number(frame.counts[state]) : "–";
      share.textContent = known ? percent(frame.counts[state], triangles) : "";
    }
    rows[2].row.classList.toggle("cmv-alarm", Boolean(frame?.truth && frame.counts[LOST] > 0));
    if (!frame) return (total.textContent = "");
    const submitted = frame.counts[UNSEEN] + frame.counts[SEEN];
    // A structure may submit one triangle from several nodes.
    const again = frame.header.submitted > submitted ? `, ${number(frame.header.submitted - submitted)} of them again` : "";
    const over = frame.truth && frame.counts[SEEN] > 0 ? `; ${(submitted / frame.counts[SEEN]).toFixed(2)} for each one seen` : "";
    return (total.textContent = `${number(submitted)} of ${number(triangles)} submitted (${percent(submitted, triangles)})${again}${over}`);
  };
  return { node, update };
}

/** Decisions at the nodes: legend, numbers and which boxes are drawn. */
export function nodeSection(nodes, tests, look, on) {
  // Culled boxes first: they are what a method does.
  const shown = new Uint8Array(256).fill(1, FIRST_CULLED);
  shown[HIDDEN] = 1;
  const depths = { least: 0, most: nodes.deepest };
  const bytes = [DRAWN, WENT_ON, ...tests.map((_, k) => FIRST_CULLED + k), HIDDEN, NOT_REACHED];
  const rows = bytes.map((byte) => {
    const count = el("td", { class: "cmv-number", text: "–" });
    const share = el("td", { class: "cmv-number cmv-share" });
    const input = el("input", { type: "checkbox", checked: shown[byte] === 1, onchange: () => {
      shown[byte] = input.checked ? 1 : 0;
      on.boxes();
    } });
    const row = el("tr", {}, el("td", {}, swatch(decisionColour(byte))),
      el("th", { scope: "row" }, el("label", {}, input, el("span", { text: decisionName(byte, tests) }))), count, share);
    return { byte, count, share, row };
  });
  const range = (label, key) => slider(label, { min: 0, max: nodes.deepest, step: 1, value: depths[key], say: String }, (v) => {
    depths[key] = v;
    // The two ends push each other, so that the range is never inside out.
    if (depths.least > depths.most) {
      depths[key === "least" ? "most" : "least"] = v;
      (key === "least" ? most : least).set(v);
    }
    on.boxes();
  });
  const least = range("From depth", "least");
  const most = range("To depth", "most");
  const option = (label, key) => checkbox(label, look[key], (v) => {
    look[key] = v;
    on.changed();
  }).node;
  const total = el("p", { class: "cmv-note" });
  const node = section("Nodes of the structure", el("table", { class: "cmv-legend" }, el("tbody", {}, ...rows.map((r) => r.row))), total,
    // All nodes of a list lie at one depth: nothing to choose from.
    ...(nodes.deepest > 0 ? [least.node, most.node] : []), option("Boxes also in the camera's view", "boxesInCamera"), option("Faces of the boxes", "faces"),
    option("Edges through walls", "through"));
  const update = (frame) => {
    for (const { byte, count, share, row } of rows) {
      // Most walks leave it to the tests what is hidden.
      if (byte === HIDDEN) row.hidden = !frame?.decisions[HIDDEN];
      count.textContent = frame ? number(frame.decisions[byte]) : "–";
      share.textContent = frame ? percent(frame.decisions[byte], nodes.count) : "";
    }
    const reached = frame ? nodes.count - frame.decisions[NOT_REACHED] : 0;
    total.textContent = frame ? `${number(reached)} of ${number(nodes.count)} nodes reached (${percent(reached, nodes.count)})` : "";
  };
  return { node, update, shown, depths };
}

/** What keys do. */
export function keySection(frames) {
  const keys = [
    ["W A S D", "fly; move the bird's eye"],
    ["Q E", "down and up; zoom"],
    ["I J K L", "look; turn the bird's eye"],
    ["Shift", "faster"],
    ["F", "fit the bird's eye"],
    ["C", "measured camera or free flight"],
    ["R", "record, and stop"],
    ["P", "place a key pose"],
    ["Drag", "look; turn the bird's eye; with Shift or the right button move"],
    ["Fingers", "one looks or turns, two move and zoom"],
    ["Wheel", "forward and back; zoom, once the view was clicked"],
  ];
  if (frames) {
    keys.unshift(["← →", "a frame back or on; 10 with Shift"], ["Home End", "first and last frame"], ["Space", "play, pause"],
      ["N", "next judged frame with a loss"]);
  }
  const list = el("dl", { class: "cmv-keys" });
  for (const [key, what] of keys) list.append(el("dt", {}, el("kbd", { text: key })), el("dd", { text: what }));
  const node = section("Keys", list);
  node.open = false;
  return node;
}
