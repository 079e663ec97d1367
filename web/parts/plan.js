// What a manifest would run: counts, time, and a table structure × culling by scene.

import { h, set } from "/parts/dom.js";
import { count, duration, number } from "/parts/format.js";

const STATES = {
  new: ["+", "new: nothing is stored"],
  done: ["✓", "done: all trials are stored, skipped"],
  partial: ["~", "partly stored: the missing trials run"],
  rerun: ["↻", "stored, but something it depends on changed: runs again"],
  rejudge: ["?", "measured, but other frames or pixels are to be judged"],
  failed: ["✕", "failed before, and kept so: not tried again by itself"],
  excluded: ["×", "excluded"],
};
const COUNTED = ["new", "partial", "rerun", "rejudge", "done", "failed"];
const FIRST_OPEN = 3;

// The state is a word, or an object with the word and why.
const stateOf = (row) => (typeof row.state === "object" && row.state ? row.state.state : row.state) || "new";
const whyOf = (row) => row.excluded || row.why || row.state?.why || "";

/** Structure, with walk and further axes where rows of one structure differ in them. */
function variantsOf(rows) {
  const walks = new Map();
  for (const r of rows) walks.set(r.structure, (walks.get(r.structure) || new Set()).add(r.walk));
  return (r) => {
    const rest = walks.get(r.structure)?.size > 1 ? [r.walk] : [];
    const axes = Array.isArray(r.axes)
      ? r.axes
      : Object.entries(r.axes || {}).map(([k, v]) => `${k} ${typeof v === "object" ? JSON.stringify(v) : v}`);
    return [r.structure, ...rest, ...axes].join(" × ");
  };
}

/**
 * A plan as nodes: numbers, notes, tables, reasons. Counts are of all runs, tables of the
 * first two thousand, which is what the server sends.
 */
export function planView(plan, notes = []) {
  const rows = plan.rows || [];
  const excluded = plan.excluded || [];
  const total = plan.rows_total ?? rows.length;
  const fact = (name, text) => h("div", null, h("dt", null, name), h("dd", null, text));
  const guess = plan.guessed
    ? h(
        "p",
        { class: "hint" },
        `The time of ${count(plan.guessed, "run")} is a guess: nothing like ${plan.guessed === 1 ? "it" : "them"} has been measured on this machine.`,
      )
    : null;
  return [
    h(
      "dl",
      { class: "facts" },
      fact("runs", number(total)),
      COUNTED.filter((k) => plan[k]).map((k) => fact(k, number(plan[k]))),
      (plan.excluded_total ?? excluded.length) > 0 &&
        fact("excluded", number(plan.excluded_total ?? excluded.length)),
      fact("trials to make", number(plan.trials)),
      fact("about", duration(plan.estimate_s)),
    ),
    guess,
    plan.duplicates
      ? h("p", { class: "hint" }, `${count(plan.duplicates, "cell")} equal to another one and left out.`)
      : null,
    notes.length > 0 &&
      h(
        "ul",
        { class: "notes" },
        notes.map((n) => h("li", null, typeof n === "string" ? n : n.message)),
      ),
    scenes(rows, excluded),
    total > rows.length &&
      h(
        "p",
        { class: "hint" },
        `Only the first ${number(rows.length)} of ${number(total)} runs are shown here.`,
      ),
    reasons(excluded),
  ];
}

/** A box for every scene with its path. */
function scenes(rows, excluded) {
  const all = [...rows, ...excluded.map((r) => ({ ...r, state: "excluded" }))];
  const groups = new Map();
  for (const r of all) {
    const name = r.path ? `${r.scene} / ${r.path}` : r.scene;
    groups.set(name, [...(groups.get(name) || []), r]);
  }
  const variant = variantsOf(all);
  return [...groups].map(([name, group], i) => {
    const box = h(
      "details",
      { class: "box", open: i < FIRST_OPEN },
      h("summary", null, name, h("span", { class: "muted" }, ` ${summary(group)}`)),
    );
    // Tables of scenes that nobody opens are not built.
    const build = () => box.children.length > 1 || box.append(table(name, group, variant));
    if (i < FIRST_OPEN) build();
    box.addEventListener("toggle", build);
    return box;
  });
}

/** "12 new, 3 done". */
function summary(group) {
  const counts = new Map();
  for (const r of group) counts.set(stateOf(r), (counts.get(stateOf(r)) || 0) + 1);
  return [...counts].map(([s, n]) => `${number(n)} ${s}`).join(", ");
}

/** Structures down, cullings across; what an axis further adds stands with the structure. */
function table(name, group, variant) {
  const variants = [...new Set(group.map(variant))];
  const cullings = [...new Set(group.map((r) => r.culling))];
  const cells = new Map(group.map((r) => [`${variant(r)}\n${r.culling}`, r]));
  const cell = (v, c) => {
    const r = cells.get(`${v}\n${c}`);
    if (!r) return h("td", { class: "plan-cell none", title: "not in the matrix" }, "");
    const state = stateOf(r);
    const [mark, about] = STATES[state] || ["·", state];
    const why = whyOf(r);
    const time = r.estimate_s ? `; about ${duration(r.estimate_s)}` : "";
    return h(
      "td",
      { class: `plan-cell ${state}`, title: `${v} × ${c}\n${about}${why ? `: ${why}` : ""}${time}` },
      h("span", { "aria-hidden": "true" }, mark),
      h("span", { class: "offscreen" }, state),
    );
  };
  return h(
    "div",
    { class: "scroll", tabindex: 0, role: "region", "aria-label": `Plan of ${name}` },
    h(
      "table",
      { class: "plan" },
      h("caption", { class: "offscreen" }, `Runs of ${name}: structures down, culling across`),
      h(
        "thead",
        null,
        h(
          "tr",
          null,
          h("th", { scope: "col" }, "structure"),
          cullings.map((c) => h("th", { scope: "col" }, h("code", null, c))),
        ),
      ),
      h(
        "tbody",
        null,
        variants.map((v) =>
          h(
            "tr",
            null,
            h("th", { scope: "row" }, h("code", null, v)),
            cullings.map((c) => cell(v, c)),
          ),
        ),
      ),
    ),
  );
}

/** Why cells are excluded, and how many for each reason. */
function reasons(excluded) {
  if (excluded.length === 0) return null;
  const counts = new Map();
  for (const r of excluded) counts.set(whyOf(r), (counts.get(whyOf(r)) || 0) + 1);
  return h(
    "div",
    null,
    h("h3", null, "Excluded"),
    h(
      "ul",
      null,
      [...counts].map(([why, n]) => h("li", null, `${count(n, "cell")}: ${why || "no reason given"}`)),
    ),
  );
}

/** The meaning of the marks. */
export const planLegend = () =>
  set(
    h("p", { class: "hint plan-legend" }),
    Object.entries(STATES).map(([state, [mark]]) => [
      h("span", { class: `plan-key ${state}` }, mark),
      ` ${state} `,
    ]),
  );
