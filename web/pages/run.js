// One run: whether it is right, its numbers, every frame, every trial, every attempt.

import { api, segment } from "/api.js";
import { metricCatalog } from "/parts/catalog.js";
import { h, set } from "/parts/dom.js";
import { count } from "/parts/format.js";
import { attemptsSection, judgedSection, metricsSection, trialsSection } from "/parts/run-sections.js";
import { framesSection } from "/parts/run-frames.js";
import { guarded } from "/parts/states.js";
import { badge } from "/parts/status.js";
import { pairs } from "/parts/pairs.js";

/** Everything of a run on one page, so that one link shows it and one search finds it. */
export function mount(root, { params, signal, setTitle }) {
  const path = `/studies/${segment(params.study)}/runs/${segment(params.run)}`;
  setTitle(`Run ${params.run}`, params.study);
  let watching = false;
  const load = () =>
    guarded(root, "Loading the run", async () => {
      const [run, catalog, list] = await Promise.all([
        api.json(path, { signal }),
        metricCatalog().catch(() => new Map()),
        // Only how many runs there are: the last one has no next.
        api.json(`/studies/${segment(params.study)}/runs`, { query: { limit: 1, columns: "status" }, signal }),
      ]);
      setTitle(`${run.label} in ${run.scene}`, params.study);
      if (run.status === "pending" && !watching) watch(run);
      return page(run, catalog, list.total);
    }, { heading: "h1" });
  load();

  /** A run that is still pending is shown anew once it has ended. */
  function watch(run) {
    watching = true;
    const stream = api.stream(`/studies/${segment(params.study)}/events`, {
      signal,
      onEvent({ event, data }) {
        if (event !== "run" || data.run !== run.run) return;
        stream.close();
        load();
      },
    });
  }

  /** From the verdict down to where it was measured. */
  function page(run, catalog, total) {
    const study = `/studies/${segment(params.study)}`;
    const view = (frame) => `${study}/runs/${run.ordinal}/view${frame === undefined ? "" : `?frame=${frame}`}`;
    const lost = (run.judged_frames || []).filter((f) => f.false_culls > 0);
    const neighbour = (ordinal, text, title) =>
      h("a", { class: "button", href: `${study}/runs/${ordinal}`, title, "aria-label": title }, text);
    return [
      h(
        "div",
        { class: "head" },
        h(
          "div",
          null,
          h(
            "p",
            { class: "kicker" },
            h("a", { href: study }, h("code", null, params.study)),
            ` › run ${run.ordinal}`,
          ),
          h("h1", null, run.label),
          h("p", { class: "muted" }, `Scene ${run.scene}, path ${run.path}`, run.walk && `, walk ${run.walk}`),
        ),
        h(
          "div",
          { class: "head-tools" },
          run.ordinal > 0 && neighbour(run.ordinal - 1, "‹", "The run before in the matrix"),
          run.ordinal + 1 < total && neighbour(run.ordinal + 1, "›", "The next run in the matrix"),
          h("a", { class: "button primary", href: view(lost[0]?.frame) }, "Frame viewer"),
        ),
      ),
      banner(run, lost),
      metricsSection(run, catalog),
      framesSection(run, { path, view, signal, name: `${params.study}-run${run.ordinal}` }),
      judgedSection(run, view),
      trialsSection(run),
      attemptsSection(run),
      whatItIs(run),
    ];
  }
}

/** The verdict comes first: no number means anything before it. */
function banner(run, lost) {
  const words = {
    done: "All trials are accepted, and the answer is right for its class.",
    pending: "Trials are still to be made; what stands below is what there is so far.",
    failed: "The run failed. Its times are withheld.",
    wrong: "The run is wrong for its declared class. Its times are withheld; its errors are its result.",
  };
  // "Right" beside "lost" needs a word: some classes promise less than others.
  const allowed =
    run.status === "done" && lost.length > 0 ? ` A method of the class “${run.class}” may lose triangles.` : "";
  return h(
    "div",
    { class: `banner ${run.status}`, role: "status" },
    h("p", null, badge(run.status), " ", words[run.status] || "", allowed),
    run.reason && h("p", { class: "reason" }, run.reason),
    lost.length > 0 && h("p", null, `Visible triangles were lost in ${count(lost.length, "judged frame")}.`),
    run.stop_reason && h("p", { class: "muted" }, `Measuring stopped: ${run.stop_reason}`),
    h(
      "p",
      { class: "muted" },
      run.class ? `Declared class: ${run.class}` : "No declared class",
      run.observed ? `; the judged frames show: ${run.observed}` : "; not judged",
    ),
  );
}

/** Parameters and environment as they are stored: names that this page does not know included. */
function whatItIs(run) {
  const { cpu, ...others } = run.environment || {};
  return h(
    "section",
    null,
    h("h2", null, "What it is, and where it was measured"),
    h(
      "div",
      { class: "columns-2" },
      set(
        h("div", { class: "card" }),
        h("h3", null, "Run"),
        pairs({
          measurement: run.run,
          structure: run.structure,
          culling: run.culling,
          walk: run.walk,
          ...objectOf(run.axes, "axes"),
          ...objectOf(run.camera, "camera"),
          machine_class: run.machine_class,
        }),
      ),
      set(
        h("div", { class: "card" }),
        h("h3", null, "Environment"),
        run.environment
          ? pairs({ cpu, ...others })
          : h("p", { class: "muted" }, "Not known: nothing has been measured yet."),
      ),
    ),
  );
}

/** `{name: value}`, or nothing for what is empty. */
const objectOf = (value, name) =>
  !value || (typeof value === "object" && Object.keys(value).length === 0) ? {} : { [name]: value };
