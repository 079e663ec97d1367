// Two studies cell by cell: ratios with intervals as a forest, what is significant, and
// what has no partner.

import { api, isAbort, segment } from "/api.js";
import { metricCatalog, metricSelect } from "/parts/catalog.js";
import { debounce, field, h, pageHead, select, set, setText } from "/parts/dom.js";
import { forest } from "/parts/forest.js";
import { cellNode, intervalTexts, missing, number } from "/parts/format.js";
import { readQuery, writeQuery } from "/parts/query.js";
import { empty, loading, problem } from "/parts/states.js";
import { virtualTable } from "/parts/virtual.js";

// Marks and words beside the colours; "lower" is good for nearly every metric, but not for all,
// so the words say lower and higher, never better and worse.
const CHANGES = {
  lower: ["↓", "lower", "significantly lower in the second: the interval lies below 1"],
  higher: ["↑", "higher", "significantly higher in the second: the interval lies above 1"],
  same: ["=", "no difference", "the interval holds 1"],
  unknown: ["?", "not known", "too few values for an interval"],
  none: ["–", "no pair", "only one of the two has a value"],
};
const COLUMNS = [
  ["scene", "scene"],
  ["structure", "structure"],
  ["culling", "culling"],
  ["first", "first"],
  ["second", "second"],
  ["ratio", "second / first"],
  ["change", "change"],
];

/** Choices above, answer below; both follow the address. */
export function mount(root, { signal, setTitle }) {
  setTitle("Compare");
  const state = { first: "", second: "", metric: "", sort: "", show: "", find: "", ...readQuery() };
  let answer = null;
  let running = null;
  let catalog = new Map();
  const form = h("div", { class: "controls" }, loading("Loading the studies"));
  const body = h("div", null);
  set(
    root,
    pageHead(
      "Compare two studies",
      "Cells are paired by scene, path, structure, culling and all other axes. A ratio is the second over the first.",
    ),
    form,
    body,
  );
  // Every choice goes into the address, so that a comparison can be sent to somebody.
  const pick = (changes) => {
    Object.assign(state, changes);
    writeQuery(changes);
  };
  start();

  /** Studies and metrics first: without them there is nothing to choose from. */
  async function start() {
    try {
      const [studies, known] = await Promise.all([
        api.json("/studies", { query: { limit: 1000 }, signal }),
        metricCatalog(),
      ]);
      catalog = known;
      drawForm(studies.items);
      load();
    } catch (error) {
      if (!isAbort(error)) set(form, problem(error, start));
    }
  }

  /** The three choices. Drawn anew when first and second change places. */
  function drawForm(studies) {
    const options = (chosen) => {
      const list = studies.map((s) => [s.ref, s.title && s.title !== s.name ? `${s.ref}: ${s.title}` : s.ref]);
      // A link may name a study by its name alone, or one further back than the list goes.
      return [
        ["", "Choose a study"],
        ...(chosen && !studies.some((s) => s.ref === chosen) ? [[chosen, chosen]] : []),
        ...list,
      ];
    };
    const metrics = metricSelect(
      catalog,
      [...catalog.keys()],
      state.metric,
      (v) => (pick({ metric: v }), load()),
    );
    metrics.prepend(h("option", { value: "", selected: !state.metric }, "culling time, frame by frame"));
    const choose = (key) => select(options(state[key]), state[key], (v) => (pick({ [key]: v }), load()));
    set(
      form,
      field("First (the basis)", choose("first"), { wide: true }),
      h(
        "button",
        {
          type: "button",
          title: "Exchange first and second",
          "aria-label": "Exchange first and second",
          onclick: () => (pick({ first: state.second, second: state.first }), drawForm(studies), load()),
        },
        "⇄",
      ),
      field("Second", choose("second"), { wide: true }),
      field("Metric", metrics),
    );
  }

  /** Asks for the comparison; a later choice overtakes an earlier one still under way. */
  async function load() {
    running?.abort();
    if (!state.first || !state.second)
      return set(
        body,
        empty(
          "Choose two studies",
          h(
            "p",
            null,
            "Two series of one study show how repeatable it is; two machines, or two versions of a program, what they change.",
          ),
        ),
      );
    running = new AbortController();
    set(body, loading("Comparing"));
    try {
      answer = await api.json("/compare", {
        query: { first: state.first, second: state.second, metric: state.metric },
        signal: AbortSignal.any([signal, running.signal]),
      });
      draw();
    } catch (error) {
      if (!isAbort(error)) set(body, problem(error, load));
    }
  }

  /** Counts as filters, then the forest: one table whose rows draw their own interval. */
  function draw() {
    const { counts, pairs } = answer;
    if (pairs.length === 0) return set(body, empty("No cell is in either study"));
    const unit = answer.unit ?? catalog.get(answer.metric)?.unit;
    const plot = forest(pairs.map((p) => p.ratio));
    const found = h("span", { class: "muted", role: "status" });
    const search = h("input", {
      type: "search",
      class: "filter-input",
      value: state.find,
      placeholder: "Filter by scene, structure or culling",
      "aria-label": "Filter the pairs",
      dataset: { filter: "" },
    });
    search.addEventListener(
      "input",
      debounce(() => (pick({ find: search.value }), refresh()), 120),
    );
    const chips = Object.entries(CHANGES).map(([key, [mark, words, about]]) =>
      h(
        "button",
        {
          type: "button",
          class: `chip change-${key}`,
          "aria-pressed": state.show === key,
          title: about,
          onclick: () => (pick({ show: state.show === key ? "" : key }), draw()),
        },
        h("b", null, `${mark} ${number(counts[key] || 0)}`),
        ` ${words}`,
      ),
    );
    let rows = [];
    const table = virtualTable({
      head: head(),
      caption: "Pairs",
      label: "Pairs, scrollable",
      rowHeight: 31,
      row: (i) => row(rows[i], plot),
    });
    /** Names that sort, and the axis over the column of intervals. */
    function head() {
      const cell = ([key, name]) => {
        const sorted = state.sort.replace("-", "") === key;
        const numeric = ["first", "second"].includes(key);
        const text =
          key === "first" || key === "second" ? [name, unit && h("span", { class: "unit" }, ` ${unit}`)] : name;
        return h(
          "th",
          {
            scope: "col",
            class: numeric ? "n" : null,
            "aria-sort": sorted ? (state.sort.startsWith("-") ? "descending" : "ascending") : null,
          },
          h(
            "button",
            {
              type: "button",
              class: "sort",
              onclick: () => (
                pick({ sort: sorted ? (state.sort.startsWith("-") ? "" : `-${key}`) : key }),
                draw()
              ),
            },
            text,
            h(
              "span",
              { class: "arrow", "aria-hidden": "true" },
              sorted ? (state.sort.startsWith("-") ? " ↓" : " ↑") : "",
            ),
          ),
        );
      };
      const cells = COLUMNS.map(cell);
      cells.splice(6, 0, h("th", { scope: "col", class: "forest-head" }, plot.axis()));
      return h("thead", null, h("tr", null, cells));
    }
    // Filters and sorts here: the answer holds all pairs, and asking again would change nothing.
    const refresh = () => {
      rows = wanted(pairs);
      setText(
        found,
        rows.length === pairs.length
          ? `${number(pairs.length)} pairs`
          : `${number(rows.length)} of ${number(pairs.length)} pairs`,
      );
      table.resize(rows.length);
    };
    const m = catalog.get(answer.metric);
    set(
      body,
      h("div", { class: "chips", role: "group", "aria-label": "Changes" }, chips),
      h(
        "p",
        { class: "hint" },
        `${m ? `${m.name}: ${m.about}` : "Ratios are of culling times paired frame by frame; beside them stand median frames"}. Bars are 95 % intervals of the ratio, on a logarithmic axis; the line is 1.`,
      ),
      h("div", { class: "controls between" }, search, found),
      table.node,
    );
    refresh();
  }

  /** Pairs that pass the filters, in the order wanted. The server puts the largest change first. */
  function wanted(pairs) {
    const words = state.find.toLowerCase().split(/\s+/).filter(Boolean);
    const list = pairs.filter(
      (p) =>
        (!state.show || p.change === state.show) &&
        words.every((w) => `${p.scene} ${p.structure} ${p.culling} ${p.label || ""}`.toLowerCase().includes(w)),
    );
    const key = state.sort.replace("-", "");
    if (!key) return list;
    const of = (p) =>
      key === "ratio" ? p.ratio?.value : key === "first" || key === "second" ? valueOf(p[key]?.value) : p[key];
    const sign = state.sort.startsWith("-") ? -1 : 1;
    return list.sort((a, b) => {
      const [x, y] = [of(a) ?? null, of(b) ?? null];
      // What is missing comes last either way.
      if (x === null || y === null) return (x === null) - (y === null);
      return sign * (typeof x === "number" ? x - y : String(x).localeCompare(String(y)));
    });
  }

  /** One pair; both values lead to their runs. */
  function row(p, plot) {
    const cell = (side, ref) =>
      h(
        "td",
        { class: "n" },
        p[side]
          ? h("a", { href: `/studies/${segment(ref)}/runs/${p[side].ordinal}` }, cellNode(p[side].value))
          : missing("not in this study"),
      );
    const [mark, words, about] = CHANGES[p.change] || ["", p.change, ""];
    const ratio = p.ratio ? texts(p.ratio) : missing(p.note || about);
    return h(
      "tr",
      null,
      h("th", { scope: "row" }, p.scene),
      h("td", { title: p.structure }, h("code", null, p.structure)),
      h(
        "td",
        { title: p.label || p.culling },
        h("code", null, p.culling),
        further(p) && h("span", { class: "muted" }, further(p)),
      ),
      cell("first", answer.first),
      cell("second", answer.second),
      h("td", { class: "n" }, ratio),
      h("td", { class: "forest-cell" }, plot.bar(p.ratio, p.change)),
      h(
        "td",
        { class: `nowrap change-${p.change}`, title: [about, p.note].filter(Boolean).join(". ") },
        `${mark} ${words}`,
      ),
    );
  }

  /** Axes beside structure and culling that the label names. */
  const further = (p) =>
    p.label?.startsWith(`${p.structure} × ${p.culling}`)
      ? p.label.slice(`${p.structure} × ${p.culling}`.length)
      : "";
  // A value may come with its interval; sorting needs the number.
  const valueOf = (v) => (v !== null && typeof v === "object" ? v?.value : v);
  // A ratio without an interval is shown as what it is: one number.
  const texts = (r) => {
    if (r.low === r.high || r.low === null || r.low === undefined) return `${number(r.value)} ×`;
    const t = intervalTexts(r);
    return [`${t.value} ×`, h("span", { class: "ci" }, ` (${t.low}–${t.high})`)];
  };
  return () => running?.abort();
}
