// The machine and the pool: is it fit to measure on, and what is it doing now.

import { api, isAbort, segment } from "/api.js";
import { notice, noticeError } from "/parts/dialog.js";
import { button, h, pageHead, set } from "/parts/dom.js";
import { instant, missing } from "/parts/format.js";
import { jobWord } from "/parts/status.js";
import { session, watchSession, whyNot } from "/parts/session.js";
import { empty, guarded, loading, problem } from "/parts/states.js";
import { pairs } from "/parts/pairs.js";

// The pool has no stream of events; asking is cheap.
const POOL_MS = 2000;
// A mark, a word and a colour each.
const VERDICTS = {
  good: ["✓", "good"],
  warn: ["▲", "could be better"],
  bad: ["✕", "spoils measurements"],
  unknown: ["?", "not known"],
};
const ORDER = ["bad", "warn", "unknown", "good"];

/** Pool above, since it changes; checks and version below. */
export function mount(root, { signal, setTitle }) {
  setTitle("Machine");
  const pool = h("div", null, loading("Asking the pool"));
  const checks = h("div");
  const version = h("div");
  set(
    root,
    pageHead("Machine", "Times are worth as much as the machine is quiet."),
    h("section", { "aria-label": "Worker pool", class: "card" }, pool),
    h("section", { "aria-label": "Checks" }, checks),
    h("section", { class: "card", "aria-label": "Version" }, h("h2", null, "Version"), version),
  );
  let timer = null;
  let last = "";

  /** Asks for the pool every other second while somebody looks. */
  async function loadPool() {
    clearTimeout(timer);
    try {
      const state = await api.json("/pool", { signal });
      const now = JSON.stringify(state) + whyNot("admin");
      // Redrawn only when it differs, so that the focus stays on the button.
      if (now !== last) set(pool, poolView(state));
      last = now;
    } catch (error) {
      if (isAbort(error)) return;
      last = "";
      set(pool, problem(error, loadPool));
    }
    if (!signal.aborted && !document.hidden) timer = setTimeout(loadPool, POOL_MS);
  }

  /** Pauses or resumes; the next look at the pool shows what came of it. */
  async function change(what) {
    try {
      await api.post(`/pool/${what}`);
      notice(what === "pause" ? "The pool pauses; what is running is finished first" : "The pool goes on");
    } catch (error) {
      noticeError("The pool could not be changed", error);
    }
    loadPool();
  }

  /** State and workers. Pausing is for the admin: it concerns the studies of all. */
  function poolView(state) {
    const busy = state.workers.filter((w) => w.study);
    const why = whyNot("admin");
    return [
      h(
        "div",
        { class: "section-head" },
        h(
          "h2",
          null,
          "Worker pool ",
          h(
            "span",
            { class: state.paused ? "badge state-paused" : "badge good" },
            state.paused ? "paused" : "running",
          ),
        ),
        state.paused
          ? button("Resume the pool", () => change("resume"), { class: "primary", why })
          : button("Pause the pool", () => change("pause"), { why }),
      ),
      state.workers.length === 0
        ? empty("No workers")
        : h(
            "div",
            { class: "scroll" },
            h(
              "table",
              null,
              h("caption", { class: "offscreen" }, "Workers"),
              h(
                "thead",
                null,
                h(
                  "tr",
                  null,
                  ["worker", "does", "study", "run", "since"].map((t) => h("th", { scope: "col" }, t)),
                ),
              ),
              h("tbody", null, state.workers.map(worker)),
            ),
          ),
      h(
        "p",
        { class: "hint" },
        busy.length
          ? ""
          : state.paused
            ? "Nothing is measured while the pool is paused."
            : "All workers wait for studies.",
      ),
    ];
  }

  // A worker without a study is idle, which is a state and not a gap.
  const worker = (w) =>
    h(
      "tr",
      null,
      h("th", { scope: "row" }, typeof w.id === "number" ? `worker ${w.id}` : h("code", null, w.id)),
      h("td", null, jobWord(w.kind) || "idle"),
      h("td", null, w.study ? h("a", { href: `/studies/${segment(w.study)}` }, w.study) : missing("idle")),
      h(
        "td",
        null,
        // What the run is called; that leads nowhere, hence no link.
        w.run ? h("code", null, w.run) : missing("idle"),
      ),
      h("td", { class: "nowrap" }, w.since ? instant(w.since) : missing("idle")),
    );

  // What spoils measurements stands first. Checked on demand: it takes the server a moment.
  const loadChecks = () =>
    guarded(checks, "Checking the machine", async () => {
      const { fit, checks: list } = await api.json("/machine", { signal });
      const sorted = [...list].sort((a, b) => ORDER.indexOf(a.verdict) - ORDER.indexOf(b.verdict));
      return [
        h(
          "div",
          { class: "section-head" },
          h(
            "h2",
            null,
            "Fit to measure on? ",
            h("span", { class: fit ? "badge good" : "badge bad" }, fit ? "yes" : "no"),
          ),
          h("button", { type: "button", onclick: loadChecks }, "Check again"),
        ),
        h(
          "div",
          { class: "scroll" },
          h(
            "table",
            { class: "checks" },
            h("caption", { class: "offscreen" }, "Checks of cullmark doctor"),
            h(
              "thead",
              null,
              h(
                "tr",
                null,
                ["check", "verdict", "found", "advice"].map((t) => h("th", { scope: "col" }, t)),
              ),
            ),
            h(
              "tbody",
              null,
              sorted.map((c) =>
                h(
                  "tr",
                  { class: c.verdict === "bad" ? "bad" : null },
                  h("th", { scope: "row" }, c.name),
                  h(
                    "td",
                    { class: "nowrap" },
                    h(
                      "span",
                      { class: `badge ${c.verdict}` },
                      h("span", { class: "mark", "aria-hidden": "true" }, VERDICTS[c.verdict]?.[0] || ""),
                      VERDICTS[c.verdict]?.[1] || c.verdict,
                    ),
                  ),
                  h("td", null, c.value ?? "–"),
                  h("td", null, c.advice || missing("nothing to do")),
                ),
              ),
            ),
          ),
        ),
      ];
    });

  watchSession(() => {
    const me = session();
    set(
      version,
      pairs({
        cullmark: me.version,
        commit: me.commit,
        your_role: me.role || "none",
        tokens: me.tokens ? "asked for" : "not asked for: whoever reaches this server may do everything",
      }),
    );
    if (last) loadPool();
  }, signal);
  document.addEventListener("visibilitychange", () => !document.hidden && loadPool(), { signal });
  loadPool();
  loadChecks();
  return () => clearTimeout(timer);
}
