// The frames of a run: charts over the path, and the same numbers as files.

import { api, isAbort } from "/api.js";
import { noticeError } from "/parts/dialog.js";
import { h, set } from "/parts/dom.js";
import { frameCharts } from "/parts/lines.js";
import { empty, loading, problem } from "/parts/states.js";

// What the numbers count, said beside each chart.
const ABOUT = {
  cull_ns: "the median over trials; every trial pale behind it",
  triangles: "submitted",
  draw_calls: "issued",
  nodes: "judged by the tests",
  nodes_visited: "judged by the tests",
};
const TITLES = { cull_ns: "culling time", draw_calls: "draw calls", nodes_visited: "nodes" };
const FIRST = ["cull_ns", "triangles", "draw_calls", "nodes", "nodes_visited"];
const SHOWN = 4;

/** How many trials have a series: told as a number, or as the list of them. */
const trialsOf = (s) => (Array.isArray(s.trials) ? s.trials.length : s.trials);

/** The section with its charts; the numbers come behind, since they may be large. */
export function framesSection(run, { path, view, signal, name }) {
  const list = run.series || [];
  const save = (format) =>
    h(
      "button",
      {
        type: "button",
        class: "small",
        onclick: () =>
          api
            .download(`${path}/series`, `${name}-frames.${format}`, { query: { format, trial: "all" } })
            .catch((e) => noticeError("The series could not be downloaded", e)),
      },
      format === "csv" ? "CSV" : "Arrow",
    );
  const body = h(
    "div",
    null,
    list.length
      ? loading("Loading the frames")
      : empty(
          "No frames yet",
          h(
            "p",
            null,
            run.status === "pending"
              ? "They appear with the first accepted trial."
              : "Nothing was recorded, or it is withheld.",
          ),
        ),
  );
  const link = h("a", { href: view(), class: "button small", hidden: true }, "");
  const section = h(
    "section",
    null,
    h(
      "div",
      { class: "section-head" },
      h("h2", null, "Frame by frame"),
      list.length > 0 &&
        h(
          "span",
          { class: "inline" },
          link,
          h("span", { class: "muted" }, "Download every trial:"),
          save("csv"),
          save("arrow"),
        ),
    ),
    body,
  );
  if (list.length) load();
  return section;

  /** Medians of everything shown and, of what a clock measured, every trial. */
  async function load() {
    const order = (n) => (FIRST.includes(n) ? FIRST.indexOf(n) : FIRST.length);
    const names = list.map((s) => s.name).sort((a, b) => order(a) - order(b));
    const shown = names
      .filter((n) => FIRST.includes(n))
      .concat(names.filter((n) => !FIRST.includes(n)))
      .slice(0, Math.max(SHOWN, names.filter((n) => FIRST.includes(n)).length));
    // Only what a clock measured differs between trials.
    const measured = list
      .filter((s) => trialsOf(s) > 1 && shown.includes(s.name) && s.name.endsWith("_ns"))
      .map((s) => s.name);
    try {
      const [medians, trials] = await Promise.all([
        api.json(`${path}/series`, { query: { names: shown.join(","), trial: "median" }, signal }),
        measured.length
          ? api.json(`${path}/series`, { query: { names: measured.join(","), trial: "all" }, signal })
          : { series: [] },
      ]);
      const charts = medians.series
        .filter((s) => s.values.length)
        .sort((a, b) => order(a.name) - order(b.name))
        .map((s) => ({
          name: s.name,
          title: TITLES[s.name] || s.name.replaceAll("_", " "),
          unit: s.unit,
          about: ABOUT[s.name],
          values: s.values,
          others: trials.series.filter((t) => t.name === s.name).map((t) => t.values),
        }));
      if (charts.length === 0)
        return set(body, empty("No frames", h("p", null, "Nothing was recorded, or it is withheld.")));
      const frames = medians.frames || charts[0].values.length;
      const marks = (run.judged_frames || []).map((f) => ({ frame: f.frame, bad: f.false_culls > 0 }));
      const group = frameCharts({
        charts,
        frames,
        marks,
        signal,
        onFrame(f) {
          link.hidden = f < 0;
          link.href = view(f);
          link.textContent = `View frame ${f}`;
        },
      });
      set(
        body,
        h(
          "div",
          { class: "card" },
          group.node,
          h(
            "p",
            { class: "hint" },
            marks.length
              ? "Green ticks on the axis: judged frames. Red triangles: judged, and visible triangles were lost. "
              : "",
            "Drag to zoom, double-click for all. Keys: arrows move (with Shift by ten), + and − zoom, 0 shows all.",
          ),
        ),
      );
    } catch (error) {
      if (!isAbort(error)) set(body, problem(error, load));
    }
  }
}
