// The tables of a run: metrics, judged frames, trials, attempts.

import { KIND_ORDER, kindName } from "/parts/catalog.js";
import { breakable, h } from "/parts/dom.js";
import { cellNode, duration, instant, missing, number } from "/parts/format.js";
import { jobWord } from "/parts/status.js";

// Heads of columns, numbers to the right.
const column = (name, numeric, unit) =>
  h(
    "th",
    { scope: "col", class: numeric ? "n" : null },
    name,
    unit && h("span", { class: "unit" }, ` ${unit}`),
  );
// A wide table scrolls by itself, by keyboard too.
const scroll = (label, table) =>
  h("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": label }, table);

/** Metrics in groups of where they come from. */
export function metricsSection(run, catalog) {
  const names = Object.keys(run.metrics || {}).filter((n) => run.metrics[n] !== null);
  const groups = [...KIND_ORDER, undefined]
    .map((kind) => [kind, names.filter((n) => catalog.get(n)?.kind === kind)])
    .filter(([, g]) => g.length);
  const body = groups.length
    ? h(
        "div",
        { class: "metric-groups" },
        groups.map(([kind, group]) => metricGroup(kind, group, run, catalog)),
      )
    : h(
        "p",
        { class: "muted" },
        run.status === "pending" ? "No values yet." : "No values: they are withheld, or nothing was measured.",
      );
  return h("section", null, h("h2", null, "Numbers"), body);
}

/** Values with units; the explanation of a metric is in its title. */
function metricGroup(kind, group, run, catalog) {
  return h(
    "div",
    { class: "card" },
    h(
      "table",
      { class: "plain metrics" },
      h("caption", null, kind ? kindName(kind) : "Others"),
      h(
        "tbody",
        null,
        group.map((n) =>
          h(
            "tr",
            null,
            h("th", { scope: "row", title: catalog.get(n)?.about }, breakable(n)),
            h("td", { class: "n" }, cellNode(run.metrics[n])),
            h("td", { class: "unit" }, catalog.get(n)?.unit || ""),
          ),
        ),
      ),
    ),
  );
}

// The order in which they are read: what was lost before what was too much.
const JUDGED = [
  "frame",
  "submitted",
  "visible",
  "false_culls",
  "false_culls_by_ray",
  "false_cull_pixels",
  "largest_blob_px",
  "submitted_unseen",
  "submitted_invisible",
  "visible_hi",
  "potential",
  "potential_lost",
  "duplicates",
  "covered_pixels",
  "pixels",
];
const NAMES = {
  frame: "frame",
  submitted: "submitted",
  visible: "visible",
  false_culls: "false culls",
  false_cull_pixels: "pixels lost",
  largest_blob_px: "largest hole",
  lost_ids: "lost triangles",
};
// The server names them in the field; a head of a column reads better without.
const UNITS = { false_cull_pixels: "px", largest_blob_px: "px", covered_pixels: "px", pixels: "px" };

/** Judged frames; those with false culls lead to the frame viewer. */
export function judgedSection(run, view) {
  const frames = run.judged_frames || [];
  const lost = frames.filter((f) => f.false_culls > 0).length;
  if (frames.length === 0)
    return h(
      "section",
      null,
      h("h2", null, "Judged frames"),
      h("p", { class: "muted" }, "No frame has been compared with the truth."),
    );
  const keys = [
    ...JUDGED.filter((k) => frames.some((f) => f[k] !== undefined)),
    ...(frames.some((f) => f.lost_ids?.length) ? ["lost_ids"] : []),
  ];
  // Red, a mark and a link where something was lost.
  const cell = (f, key) => {
    if (key === "frame")
      return h(
        "th",
        { scope: "row", class: "n" },
        h(
          "a",
          { href: view(f.frame), class: f.false_culls > 0 ? "alarm" : null },
          `${f.false_culls > 0 ? "✕ " : ""}${number(f.frame)}`,
        ),
      );
    if (key === "lost_ids")
      return h(
        "td",
        { class: "nowrap" },
        f.lost_ids?.length
          ? f.lost_ids.slice(0, 5).join(", ") + (f.lost_ids.length > 5 ? " …" : "")
          : missing("none lost"),
      );
    return h(
      "td",
      {
        class:
          f.false_culls > 0 && ["false_culls", "false_cull_pixels", "largest_blob_px"].includes(key)
            ? "n alarm"
            : "n",
      },
      typeof f[key] === "number" ? number(f[key]) : missing("not judged"),
    );
  };
  return h(
    "section",
    null,
    h("h2", null, "Judged frames"),
    h(
      "p",
      { class: lost ? "alarm" : "muted" },
      lost
        ? `${lost} of ${frames.length} judged frames lose visible triangles. Their numbers lead to the frame viewer.`
        : `None of ${frames.length} judged frames loses a visible triangle.`,
    ),
    scroll(
      "Judged frames",
      h(
        "table",
        null,
        h("caption", { class: "offscreen" }, "Judged frames"),
        h(
          "thead",
          null,
          h(
            "tr",
            null,
            keys.map((k) => column(NAMES[k] || k.replaceAll("_", " "), k !== "lost_ids", UNITS[k])),
          ),
        ),
        h(
          "tbody",
          null,
          frames.map((f) =>
            h(
              "tr",
              { class: f.false_culls > 0 ? "bad" : null },
              keys.map((k) => cell(f, k)),
            ),
          ),
        ),
      ),
    ),
  );
}

// Times of a trial in the order in which they pass.
const TRIAL = [
  ["total_cull_ms", "culling, whole path", "ms"],
  ["build_ms", "build", "ms"],
  ["prepare_ms", "prepare", "ms"],
  ["load_ms", "load", "ms"],
  ["peak_rss_mib", "peak memory", "MiB"],
  ["noise", "noise", "× usual"],
];

/** Every trial; noise is flagged, since it explains outliers better than any statistic. */
export function trialsSection(run) {
  const trials = run.trials || [];
  if (trials.length === 0)
    return h(
      "section",
      null,
      h("h2", null, "Trials"),
      h(
        "p",
        { class: "muted" },
        run.status === "pending"
          ? "None yet."
          : "None that is shown: times are withheld, or no trial was accepted.",
      ),
    );
  // Noise is a remark, not a verdict: noisy trials are kept unless they are replaced.
  const state = (t) => [
    t.accepted === false ? h("span", { class: "badge bad" }, "not accepted") : null,
    t.noisy
      ? h(
          "span",
          {
            class: "badge noisy",
            title: "The sentinel took longer than it usually does: something else kept the machine busy",
          },
          "≈ noisy",
        )
      : null,
  ];
  return h(
    "section",
    null,
    h("h2", null, "Trials"),
    scroll(
      "Trials",
      h(
        "table",
        null,
        h("caption", { class: "offscreen" }, "Trials"),
        h(
          "thead",
          null,
          h(
            "tr",
            null,
            column("repeat", true),
            column("take", true),
            TRIAL.map(([, name, unit]) => column(name, true, unit)),
            column("accepted"),
            column("remarks"),
          ),
        ),
        h(
          "tbody",
          null,
          trials.map((t) =>
            h(
              "tr",
              null,
              h("th", { scope: "row", class: "n" }, t.repeat),
              h("td", { class: "n" }, t.take ?? missing()),
              TRIAL.map(([key]) =>
                h("td", { class: "n" }, typeof t[key] === "number" ? number(t[key], 4) : missing()),
              ),
              h(
                "td",
                { class: "nowrap" },
                typeof t.accepted === "string" ? instant(t.accepted) : t.accepted ? "yes" : "no",
              ),
              h("td", null, state(t)),
            ),
          ),
        ),
      ),
    ),
  );
}

/** Who tried what and when: open where a run failed, since there it is the story. */
export function attemptsSection(run) {
  const attempts = run.attempts || [];
  if (attempts.length === 0) return null;
  // An attempt without an end is still running, or its worker is gone.
  const took = (a) =>
    a.started && a.ended
      ? duration((Date.parse(a.ended) - Date.parse(a.started)) / 1000)
      : missing("still running");
  const outcome = (a) => {
    const bad = !/^(accepted|returned|cancelled|done|ok)/i.test(a.outcome || "ok");
    return h("span", { class: bad ? "alarm" : null }, a.outcome || "running");
  };
  return h(
    "details",
    { class: "box", open: run.status === "failed" },
    h("summary", null, `Attempts (${attempts.length})`),
    scroll(
      "Attempts",
      h(
        "table",
        null,
        h("caption", { class: "offscreen" }, "Attempts"),
        h(
          "thead",
          null,
          h(
            "tr",
            null,
            column("what"),
            column("repeat", true),
            column("take", true),
            column("started"),
            column("took", true),
            column("worker"),
            column("outcome"),
            column("detail"),
          ),
        ),
        h(
          "tbody",
          null,
          attempts.map((a) =>
            h(
              "tr",
              null,
              h("th", { scope: "row" }, jobWord(a.kind)),
              h("td", { class: "n" }, a.repeat ?? missing()),
              h("td", { class: "n" }, a.take ?? missing()),
              h("td", { class: "nowrap" }, instant(a.started)),
              h("td", { class: "n" }, took(a)),
              h("td", null, h("code", null, a.owner || "–")),
              h("td", null, outcome(a)),
              h("td", { class: "detail" }, a.detail || missing("none")),
            ),
          ),
        ),
      ),
    ),
  );
}
