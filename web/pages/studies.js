// The list of studies: how far each is, and what can be done with it.

import { api, isAbort, segment } from "/api.js";
import { debounce, h, pageHead, select, set } from "/parts/dom.js";
import { instant, number } from "/parts/format.js";
import { readQuery, writeQuery } from "/parts/query.js";
import { empty, loading, problem } from "/parts/states.js";
import { progress, remaining, stateBadge } from "/parts/status.js";
import { studyActions } from "/parts/study-actions.js";

const PAGE = 50;
const MOST = 1000;
// The server streams the progress of single studies only, so the list asks again:
// often while something runs, seldom otherwise, never while the tab is hidden.
const BUSY_MS = 2500;
const IDLE_MS = 15000;

// "Unfinished" is what most people come back for.
const KINDS = [
  ["", "All studies"],
  ["unfinished", "Unfinished"],
  ["finished", "Finished"],
  ["paused", "Paused"],
  ["cancelled", "Cancelled"],
  ["problems", "With failed or wrong runs"],
];

/** Whether a study belongs to a choice of the list. */
function isKind(s, kind) {
  if (kind === "unfinished") return !s.finished && s.state !== "cancelled";
  if (kind === "finished") return s.finished;
  if (kind === "problems") return s.runs.failed + s.runs.wrong > 0;
  return !kind || s.state === kind;
}

/** List, filter and the question that keeps them up to date. */
export function mount(root, { signal, navigate, setTitle }) {
  setTitle("Studies");
  const state = { search: "", show: "", ...readQuery() };
  const rows = new Map();
  let items = [];
  let next = null;
  let timer = null;

  const search = h("input", {
    type: "search",
    placeholder: "Filter by name or title",
    "aria-label": "Filter studies by name or title",
    value: state.search,
    dataset: { filter: "" },
    size: 26,
  });
  const kind = select(KINDS, state.show, (v) => (remember({ show: v }), draw()), {
    "aria-label": "Which studies",
  });
  const body = h("tbody");
  const table = h(
    "table",
    { class: "studies" },
    h("caption", { class: "offscreen" }, "Studies, the latest first"),
    h(
      "thead",
      null,
      h(
        "tr",
        null,
        ["Study", "Progress", "State", "Priority", "Created", ""].map((t, i) =>
          h(
            "th",
            { scope: "col", class: i === 3 ? "n" : null },
            t || h("span", { class: "offscreen" }, "Actions"),
          ),
        ),
      ),
    ),
    body,
  );
  const more = h(
    "p",
    { class: "center", hidden: true },
    h("button", { type: "button", onclick: () => load({ more: true }) }, "Show older studies"),
  );
  const place = h("div", null, loading("Loading the studies"));
  const lost = h("p", { class: "alarm", role: "status", hidden: true });

  set(
    root,
    pageHead(
      "Studies",
      null,
      search,
      kind,
      h("a", { class: "button primary", href: "/submit" }, "New study"),
    ),
    lost,
    place,
    more,
  );
  search.addEventListener(
    "input",
    debounce(() => (remember({ search: search.value }), draw()), 120),
  );

  /** Filter and choice live in the address. */
  function remember(changes) {
    Object.assign(state, changes);
    writeQuery(changes);
  }

  /** Shows what passes the filter, or says why there is nothing. */
  function draw() {
    const words = state.search.toLowerCase().split(/\s+/).filter(Boolean);
    const wanted = items.filter(
      (s) => isKind(s, state.show) && words.every((w) => `${s.ref} ${s.title}`.toLowerCase().includes(w)),
    );
    more.hidden = !next;
    if (items.length === 0) return set(place, firstSteps());
    if (wanted.length === 0)
      return set(
        place,
        empty(
          "No study matches the filter",
          h("p", null, h("button", { type: "button", onclick: clear }, "Show all")),
        ),
      );
    // Rows stay the same nodes: an open menu or the focus survives an update.
    for (const s of wanted) {
      if (!rows.has(s.ref)) rows.set(s.ref, studyRow(s, { onChange: changed, navigate }));
      else rows.get(s.ref).update(s);
    }
    const nodes = wanted.map((s) => rows.get(s.ref).node);
    if (nodes.length !== body.children.length || nodes.some((n, i) => body.children[i] !== n))
      body.replaceChildren(...nodes);
    if (!table.isConnected) set(place, h("div", { class: "wide-scroll" }, table));
  }

  /** Takes all filters away. */
  function clear() {
    search.value = "";
    kind.value = "";
    remember({ search: "", show: "" });
    draw();
  }

  /** After an action: shows its answer at once, and asks for what else it changed. */
  function changed(ref, summary) {
    const i = items.findIndex((s) => s.ref === ref);
    if (!summary && i >= 0) items.splice(i, 1);
    else if (summary?.ref === ref && i >= 0) items[i] = summary;
    draw();
    // A re-run is a new study that the list does not know yet.
    load();
  }

  /**
   * Asks for what is shown, or for the next page. When the server is lost the list stays,
   * marked as out of date.
   */
  async function load({ more: older = false } = {}) {
    clearTimeout(timer);
    try {
      const query = older
        ? { limit: PAGE, cursor: next }
        : { limit: Math.min(MOST, Math.max(PAGE, items.length)) };
      const page = await api.json("/studies", { query, signal });
      items = older ? [...items, ...page.items] : page.items;
      next = page.next;
      lost.hidden = true;
      draw();
    } catch (error) {
      if (isAbort(error)) return;
      if (items.length === 0)
        set(
          place,
          problem(error, () => load()),
        );
      else {
        set(lost, `Not up to date: ${error.detail || error.title}`);
        lost.hidden = false;
      }
    }
    schedule();
  }

  /** The next question, sooner while something runs. */
  function schedule() {
    clearTimeout(timer);
    if (signal.aborted || document.hidden) return;
    const busy = items.some((s) => s.state === "active" && !s.finished);
    timer = setTimeout(load, busy ? BUSY_MS : IDLE_MS);
  }

  // A tab that comes back is out of date.
  const seen = () => (document.hidden ? clearTimeout(timer) : load());
  document.addEventListener("visibilitychange", seen, { signal });
  load();
  return () => clearTimeout(timer);
}

/** A row that is updated in place. */
function studyRow(summary, { onChange, navigate }) {
  const address = `/studies/${segment(summary.ref)}`;
  const bar = progress(summary);
  const left = h("div", { class: "hint" });
  const state = h("td", { dataset: { label: "State" } });
  const priority = h("td", { class: "n", dataset: { label: "Priority" } });
  const created = h("td", { class: "nowrap", dataset: { label: "Created" } });
  const actions = studyActions(summary, { onChange, navigate, compact: true });
  const title = h("span", { class: "study-title" });
  const node = h(
    "tr",
    null,
    h(
      "th",
      { scope: "row", class: "study-name" },
      h("a", { href: address }, title),
      h("div", { class: "hint" }, h("code", null, summary.ref)),
    ),
    h("td", { class: "study-progress", dataset: { label: "Progress" } }, bar, left),
    state,
    priority,
    created,
    h("td", { class: "study-actions" }, actions.node),
  );
  const update = (s) => {
    set(title, s.title || s.name);
    bar.update(s);
    set(left, s.finished ? "" : remaining(s));
    set(state, stateBadge(s));
    set(priority, number(s.priority));
    set(created, instant(s.created));
    actions.update(s);
  };
  update(summary);
  return { node, update };
}

// An empty list is a beginning.
const firstSteps = () =>
  empty(
    "No studies yet",
    h(
      "p",
      null,
      "A study is a TOML manifest: scenes, structures and culling tests, and how often each is measured. The examples run as they are.",
    ),
    h("p", null, h("a", { class: "button primary", href: "/submit" }, "Submit the first study")),
  );
