// What is not in the matrix and why, and where and how the rest was measured.

import { h } from "/parts/dom.js";
import { count, number } from "/parts/format.js";
import { pairs, valueText } from "/parts/pairs.js";

/** All of it is in the study itself; nothing is asked. */
export async function mount(panel, { detail }) {
  panel.append(
    excluded(detail.excluded_cells || []),
    ...[
      axes(detail.axes || {}),
      policy(detail.policy || {}),
      ...Object.entries(detail.environments || {}).map(([name, env]) => environment(name, env)),
    ].filter(Boolean),
  );
  return null;
}

/** Cells left out on purpose, with the reasons of the manifest. */
function excluded(cells) {
  if (cells.length === 0)
    return h(
      "section",
      { class: "card" },
      h("h2", null, "Excluded"),
      h("p", { class: "muted" }, "No cell of the matrix is excluded."),
    );
  const total = cells.reduce((sum, c) => sum + (c.count || 1), 0);
  return h(
    "section",
    { class: "card" },
    h("h2", null, `Excluded: ${count(total, "cell")}`),
    h(
      "div",
      { class: "scroll" },
      h(
        "table",
        null,
        h("caption", { class: "offscreen" }, "Excluded cells and why"),
        h(
          "thead",
          null,
          h(
            "tr",
            null,
            h("th", { scope: "col" }, "cell"),
            h("th", { scope: "col" }, "why"),
            h("th", { scope: "col", class: "n" }, "count"),
          ),
        ),
        h(
          "tbody",
          null,
          cells.map((c) =>
            h(
              "tr",
              null,
              h("th", { scope: "row" }, h("code", null, c.cell)),
              h("td", null, c.why),
              h("td", { class: "n" }, number(c.count)),
            ),
          ),
        ),
      ),
    ),
  );
}

/** What the matrix is the product of. */
function axes(all) {
  const names = Object.keys(all);
  if (names.length === 0) return null;
  return h(
    "section",
    { class: "card" },
    h("h2", null, "Axes"),
    h(
      "dl",
      { class: "pairs" },
      names.map((n) => [
        h("dt", null, n),
        h(
          "dd",
          null,
          all[n].map((v, i) => [i ? ", " : "", h("code", null, valueText(v))]),
        ),
      ]),
    ),
  );
}

// Repeats, passes, limits: as the server keeps them.
const policy = (p) =>
  Object.keys(p).length > 0 && h("section", { class: "card" }, h("h2", null, "How it is measured"), pairs(p));
const environment = (name, env) =>
  h("section", { class: "card" }, h("h2", null, "Environment ", h("code", null, name)), pairs(env));
