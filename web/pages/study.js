// A study: its header with progress as it happens, and tabs that show its results.

import { api, isAbort, segment } from "/api.js";
import { notice } from "/parts/dialog.js";
import { h, set, setText, throttle } from "/parts/dom.js";
import { count, instant, number } from "/parts/format.js";
import { filterBox } from "/parts/filter-box.js";
import { readQuery, writeQuery } from "/parts/query.js";
import { watchSession } from "/parts/session.js";
import { empty, fetchPart, guarded, problem } from "/parts/states.js";
import { announcer, jobWord, progress, remaining, stateBadge } from "/parts/status.js";
import { studyActions } from "/parts/study-actions.js";
import { tabs } from "/parts/tabs.js";

// A study's tabs; `filter` says whether the filter box belongs to it.
const TABS = [
  { id: "matrix", label: "Matrix", filter: true, load: () => import("/pages/study-matrix.js") },
  { id: "table", label: "Table", filter: true, load: () => import("/pages/study-table.js") },
  { id: "fronts", label: "Fronts", filter: true, load: () => import("/pages/study-fronts.js") },
  { id: "claims", label: "Claims", load: () => import("/pages/study-claims.js") },
  { id: "charts", label: "Charts", filter: true, load: () => import("/pages/study-charts.js") },
  { id: "manifest", label: "Manifest", load: () => import("/pages/study-manifest.js") },
  { id: "about", label: "Excluded & environment", load: () => import("/pages/study-about.js") },
];
const DRAW_MS = 400;
const HIDDEN_MS = 20000;
const MOST_NAMED = 4;
// Judgements have none.
const hasRepeat = (r) => r.kind === "trial" && Number.isInteger(r.repeat);

/** The study first: nothing can be drawn without its fields and metrics. */
export function mount(root, { params, signal, navigate, setTitle }) {
  const ref = params.study;
  setTitle(ref);
  let leaveTab = () => {};
  const first = guarded(root, "Loading the study", async () => {
    const detail = await api.json(`/studies/${segment(ref)}`, { signal });
    return page(detail);
  }, { heading: "h1" });
  first.catch(() => {});

  /** Header and tabs; tabs fetch what they need when they are opened. */
  function page(detail) {
    let summary = detail;
    // A name alone is the latest series: from here on it is this one, whatever comes later.
    const path = `/studies/${segment(detail.ref)}`;
    setTitle(detail.title || detail.ref);
    const bar = progress(detail);
    const facts = h("p", { class: "study-facts" });
    const running = h("p", { class: "hint running" });
    const link = h("span", { class: "live", hidden: true });
    const spoken = announcer();
    const actions = studyActions(detail, {
      navigate,
      onChange(_, next) {
        if (!next) return navigate("/");
        // A re-run answers with the next series, which is another page.
        if (next.ref === summary.ref) draw(next);
        // The stream ended with the study; a retry begins it again.
        if (ended && !next.finished) watch();
      },
    });
    let tab = null;
    const study = {
      ref: detail.ref,
      path,
      detail,
      navigate,
      where: readQuery().where || "",
      signal,
      filterError: (error) => box.fail(error),
      /** Shows in `node` why it could not be loaded. True for a mistaken filter, whose words stand above. */
      failed(node, error, retry, { quiet = false } = {}) {
        if (isAbort(error)) return false;
        const mistaken = box.fail(error);
        if (mistaken) set(node, empty("The filter is not valid"));
        else if (!quiet) set(node, problem(error, retry));
        return mistaken;
      },
      /** True when runs brought metrics that the study did not have when it was loaded. */
      async grown() {
        const known = detail.metrics.length;
        Object.assign(detail, await api.json(path, { signal }));
        return detail.metrics.length > known;
      },
      reopen: () => chooser.reopen(),
      async reload() {
        await study.grown();
        chooser.reopen();
      },
    };
    const box = filterBox(detail.fields, study.where, (where) => {
      study.where = where;
      writeQuery({ where });
      tab?.refilter?.();
    });
    const chooser = tabs(
      TABS.map((t) => (t.id === "claims" && detail.claims ? { ...t, label: `Claims (${detail.claims})` } : t)),
      { label: "Results", onSelect: (id) => open(id) },
    );
    chooser.reopen = () => open(readQuery().tab || "matrix");

    /** Ends the tab that is shown and mounts another. */
    async function open(id) {
      leaveTab();
      const def = TABS.find((t) => t.id === id) || TABS[0];
      writeQuery({ tab: def.id === "matrix" ? null : def.id });
      box.node.hidden = !def.filter;
      box.fail(null);
      const ending = new AbortController();
      const panel = h("div");
      set(chooser.panel, panel);
      leaveTab = () => {
        ending.abort();
        tab?.destroy?.();
        tab = null;
        leaveTab = () => {};
      };
      try {
        const module = await fetchPart(def.load);
        if (ending.signal.aborted) return;
        const made = await module.mount(panel, {
          ...study,
          get where() {
            return study.where;
          },
          signal: ending.signal,
        });
        if (ending.signal.aborted) made?.destroy?.();
        else tab = made;
      } catch (error) {
        if (!isAbort(error) && !ending.signal.aborted) {
          console.error(error);
          set(
            panel,
            problem(error, () => open(id)),
          );
        }
      }
    }

    /** What changes while the study runs. */
    function draw(next) {
      summary = { ...summary, ...next };
      bar.update(summary);
      actions.update(summary);
      set(
        facts,
        stateBadge(summary),
        " ",
        h("span", { class: "muted" }, [
          "created ",
          instant(summary.created),
          summary.priority ? `, priority ${number(summary.priority)}` : "",
          summary.machine_class ? `, machine class ${summary.machine_class}` : "",
        ]),
      );
      const now = (summary.running || [])
        .slice(0, MOST_NAMED)
        .map((r) => [
          " · ",
          `${jobWord(r.kind)} of `,
          h("code", null, r.run),
          hasRepeat(r) ? `, repeat ${r.repeat}` : "",
        ]);
      set(running, summary.finished ? "" : [remaining(summary), now]);
    }
    draw(detail);

    // Many events a second are many reasons to draw once.
    let latest = null;
    const drawSoon = throttle(() => {
      draw(latest);
      const { runs } = summary;
      spoken.say(
        `${number(runs.total - runs.pending)} of ${count(runs.total, "run")} are finished, ${runs.failed} failed, ${runs.wrong} wrong`,
      );
    }, DRAW_MS);
    let ended = false;
    let stream = null;
    /** Listens to the study until it is finished, deleted or left. */
    function watch() {
      ended = false;
      stream?.close();
      stream = api.stream(`${path}/events`, {
        signal,
        onEvent({ event, data }) {
          if (event === "progress") {
            latest = data;
            drawSoon();
          } else if (event === "run") tab?.live?.(data);
          else if (event === "end") tab?.live?.(null);
          else if (event === "deleted") {
            stream.close();
            notice(`${detail.ref} was deleted`);
            navigate("/");
          }
        },
        onState(how) {
          ended = how === "ended";
          link.hidden = ended || (how === "live" && summary.finished);
          link.className = `live ${how}`;
          setText(link, how === "live" ? "live" : "connection lost, trying again");
        },
      });
    }
    watch();
    // Browsers allow few connections to a server: a tab that nobody sees gives its one back.
    let asleep = null;
    const seen = () => {
      clearTimeout(asleep);
      if (document.hidden) asleep = setTimeout(() => stream.close(), HIDDEN_MS);
      else if (!ended && stream.closed) watch();
    };
    document.addEventListener("visibilitychange", seen, { signal });
    watchSession(() => actions.update(summary), signal);
    signal.addEventListener("abort", () => drawSoon.cancel());

    queueMicrotask(() => chooser.choose(readQuery().tab || "matrix"));
    return [
      h(
        "div",
        { class: "head" },
        h(
          "div",
          null,
          h("p", { class: "kicker" }, "Study ", h("code", null, detail.ref)),
          h("h1", null, detail.title || detail.name),
          detail.description && h("p", { class: "muted" }, detail.description),
          facts,
        ),
        h(
          "div",
          { class: "head-tools" },
          h("a", { class: "button", href: `/compare?first=${encodeURIComponent(detail.ref)}` }, "Compare…"),
          actions.node,
        ),
      ),
      h(
        "section",
        { class: "card progress-card", "aria-label": "Progress" },
        bar,
        h("div", { class: "progress-notes" }, running, link),
        spoken,
      ),
      h("div", { class: "tab-row" }, chooser.bar),
      box.node,
      chooser.panel,
    ];
  }

  return () => leaveTab();
}
