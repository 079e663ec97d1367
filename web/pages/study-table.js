// The runs of a study as a table: sorted and filtered by the server, fetched as one
// scrolls, with any of its fields as columns.

import { api, isAbort, segment } from "/api.js";
import { KIND_ORDER, kindName, metricCatalog } from "/parts/catalog.js";
import { ask, noticeError } from "/parts/dialog.js";
import { h, set, setText, throttle, uid } from "/parts/dom.js";
import { cellNode, number } from "/parts/format.js";
import { readQuery, writeQuery } from "/parts/query.js";
import { empty, loading } from "/parts/states.js";
import { badge } from "/parts/status.js";
import { virtualTable } from "/parts/virtual.js";

const PAGE = 200;
// What the server sends at once.
const MOST = 1000;
const LIVE_MS = 5000;
const SELDOM_MS = 20000;
const DEFAULT = [
  "scene",
  "structure",
  "culling",
  "status",
  "total_cull_ms",
  "p99_frame_us",
  "frame_ms_model",
  "mean_triangles",
  "false_cull_ppm",
  "over_submission",
  "structure_mib",
];
// Withheld, not judged and not measured are different reasons for the same dash.
const WHY = {
  pending: "not measured yet",
  failed: "the run failed",
  wrong: "withheld: the run is wrong for its class",
  done: "the run has no such value",
};

/** A table that grows as one scrolls; filter, order and columns are in the address. */
export async function mount(panel, study) {
  const { signal } = study;
  const query = readQuery();
  // An address may be older than the study's fields, or another study's.
  const isField = (name) => study.detail.fields.includes(name);
  const state = {
    sort: (query.sort || "").split(",").filter((s) => isField(s.replace(/^-/, ""))),
    columns: (query.columns || "").split(",").filter(isField),
  };
  if (state.columns.length === 0) state.columns = DEFAULT.filter(isField);
  const catalog = await metricCatalog().catch(() => new Map());
  if (signal.aborted) return null;

  let items = [];
  let columns = [];
  let next = null;
  let total = 0;
  let fetching = null;
  let table = null;
  const count = h("span", { class: "muted", role: "status" });
  const place = h("div", null, loading("Loading the runs"));
  set(
    panel,
    h(
      "div",
      { class: "controls between" },
      count,
      h(
        "span",
        { class: "inline" },
        h("button", { type: "button", onclick: chooseColumns }, "Columns…"),
        h("button", { type: "button", onclick: saveCsv }, "Download CSV"),
      ),
    ),
    place,
  );

  // What all questions have in common.
  const request = (more) => ({
    where: study.where,
    sort: state.sort.join(","),
    columns: state.columns.join(","),
    ...more,
  });

  const fetchPage = (more, { signal: ours }) =>
    api.json(`${study.path}/runs`, { query: request(more), signal: AbortSignal.any([signal, ours]) });

  /** The first page, or quietly everything seen so far. */
  async function load({ quiet = false } = {}) {
    fetching?.abort();
    fetching = new AbortController();
    const mine = fetching;
    if (!quiet) set(place, loading("Loading the runs"));
    try {
      // While results come in, what has been seen is fetched again.
      const limit = quiet ? Math.min(MOST, Math.max(PAGE, items.length)) : PAGE;
      const page = await fetchPage({ limit }, mine);
      // A page of the server ends at a thousand; a list that was scrolled further takes several.
      while (quiet && page.next && page.items.length < items.length) {
        const further = await fetchPage({ limit: MOST, cursor: page.next }, mine);
        page.items.push(...further.items);
        page.next = further.next;
      }
      study.filterError(null);
      const sameHead =
        table &&
        quiet &&
        page.columns.map((c) => c.name).join() === columns.map((c) => c.name).join();
      ({ columns, items, next, total } = page);
      if (total === 0)
        return (set(place, empty(study.where ? "No run matches the filter" : "The study has no runs")), tell());
      if (!sameHead) {
        table = virtualTable({
          head: head(),
          caption: `Runs of ${study.ref}`,
          label: "Runs, scrollable",
          row,
          onNearEnd: more,
        });
        set(place, table.node);
      }
      table.resize(items.length, total);
      tell();
    } catch (error) {
      if (study.failed(place, error, () => load(), { quiet })) setText(count, "");
    } finally {
      if (fetching === mine) fetching = null;
    }
  }

  /** The next page, when the end comes near. */
  async function more() {
    if (!next || fetching) return;
    fetching = new AbortController();
    const mine = fetching;
    try {
      const page = await fetchPage({ limit: PAGE, cursor: next }, mine);
      items = items.concat(page.items);
      next = page.next;
      total = page.total ?? total;
      fetching = null;
      table.resize(items.length, total);
      tell();
    } catch (error) {
      if (!isAbort(error)) noticeError("More runs could not be loaded", error);
      // Left as it is: scrolling on asks again.
      if (fetching === mine) fetching = null;
    }
  }

  // How many there are, and how many of them are here.
  const tell = () =>
    setText(
      count,
      `${number(total)} ${total === 1 ? "run" : "runs"}${items.length < total ? `, the first ${number(items.length)} loaded` : ""}`,
    );

  /** Names that sort, with units and explanations. */
  function head() {
    const cell = (c) => {
      const key = state.sort.find((s) => s.replace(/^-/, "") === c.name);
      const descending = key?.startsWith("-");
      return h(
        "th",
        {
          scope: "col",
          class: isNumeric(c) ? "n" : null,
          "aria-sort": key ? (descending ? "descending" : "ascending") : null,
        },
        h(
          "button",
          {
            type: "button",
            class: "sort",
            title: `${c.about || c.name}. Click to sort; with Shift as a further key`,
            onclick: (event) => sortBy(c.name, event.shiftKey),
          },
          c.name,
          c.unit && h("span", { class: "unit" }, ` ${c.unit}`),
          h("span", { class: "arrow", "aria-hidden": "true" }, key ? (descending ? " ↓" : " ↑") : ""),
        ),
      );
    };
    return h("thead", null, h("tr", null, h("th", { scope: "col", class: "n" }, "run"), columns.map(cell)));
  }

  // Numbers stand right, and with tabular figures.
  const isNumeric = (c) => catalog.has(c.name) || items.some((r) => typeof r.cells[c.name] === "number");

  /** A run; a dash says in its title why there is no value. */
  function row(i) {
    const run = items[i];
    const address = `/studies/${segment(study.ref)}/runs/${run.ordinal}`;
    return h(
      "tr",
      { class: run.status === "failed" || run.status === "wrong" ? "not-done" : null },
      h("th", { scope: "row", class: "n" }, h("a", { href: address, title: run.label }, run.ordinal)),
      columns.map((c) => {
        if (c.name === "status") return h("td", null, badge(run.status, { small: true }));
        const value = run.cells[c.name];
        return h(
          "td",
          { class: isNumeric(c) ? "n" : null, title: typeof value === "string" ? value : null },
          cellNode(value, WHY[run.status]),
        );
      }),
    );
  }

  /** Ascending, descending, unsorted; Shift keeps the other keys. */
  function sortBy(name, keep) {
    const old = state.sort.find((s) => s.replace(/^-/, "") === name);
    const now = !old ? name : old === name ? `-${name}` : null;
    if (keep)
      state.sort = old
        ? state.sort.flatMap((s) => (s === old ? (now ? [now] : []) : [s]))
        : [...state.sort, name];
    else state.sort = now ? [now] : [];
    writeQuery({ sort: state.sort.join(",") });
    load().then(() => table?.node.querySelector("th[aria-sort] button")?.focus({ preventScroll: true }));
  }

  /** All fields of the study, in groups. */
  async function chooseColumns() {
    const chosen = new Set(state.columns);
    const group = (name, fields) =>
      fields.length > 0 &&
      h(
        "fieldset",
        null,
        h("legend", null, name),
        fields.map((f) =>
          h(
            "label",
            { class: "check", title: catalog.get(f)?.about },
            h("input", { type: "checkbox", name: f, checked: chosen.has(f) }),
            f,
          ),
        ),
      );
    const { fields } = study.detail;
    const metrics = fields.filter((f) => catalog.has(f));
    const search = h("input", {
      type: "search",
      id: uid("columns"),
      placeholder: "Find a field",
      "aria-label": "Find a field",
    });
    const groups = h(
      "div",
      { class: "columns" },
      group(
        "About the run",
        fields.filter((f) => !catalog.has(f)),
      ),
      KIND_ORDER.map((k) =>
        group(
          kindName(k),
          metrics.filter((m) => catalog.get(m).kind === k),
        ),
      ),
    );
    search.addEventListener("input", () => {
      for (const label of groups.querySelectorAll("label"))
        label.hidden = !label.textContent.includes(search.value.trim());
    });
    const reset = h(
      "button",
      {
        type: "button",
        class: "quiet",
        onclick: () => groups.querySelectorAll("input").forEach((i) => (i.checked = DEFAULT.includes(i.name))),
      },
      "The usual columns",
    );
    const values = await ask({
      title: "Columns",
      body: [h("div", { class: "controls" }, search, reset), groups],
      confirm: "Show",
    });
    if (!values) return;
    // What stays keeps its place; what is new comes after.
    const now = state.columns.filter((c) => c in values);
    state.columns = [...now, ...Object.keys(values).filter((f) => !now.includes(f) && fields.includes(f))];
    if (state.columns.length === 0) state.columns = DEFAULT;
    writeQuery({ columns: state.columns.join() === DEFAULT.join() ? null : state.columns.join(",") });
    load();
  }

  /** What is shown, all pages of it, as the server writes it. */
  async function saveCsv(event) {
    const button = event.currentTarget;
    button.disabled = true;
    try {
      await api.download(`${study.path}/runs`, `${study.ref}-runs.csv`, { query: request({ format: "csv" }) });
    } catch (error) {
      noticeError("The table could not be downloaded", error);
    } finally {
      button.disabled = false;
    }
  }

  load();
  // Many pages are dear to ask for, so a long list is brought up to date less often.
  const live = throttle(() => load({ quiet: true }), LIVE_MS);
  const seldom = throttle(() => load({ quiet: true }), SELDOM_MS);
  return {
    refilter: () => load(),
    live: () => (items.length > MOST ? seldom() : live()),
    destroy() {
      live.cancel();
      seldom.cancel();
      fetching?.abort();
    },
  };
}
