// Pareto fronts, scene by scene: what no other run beats in both of two metrics.

import { api, segment } from "/api.js";
import { firstOf, metricCatalog, metricSelect } from "/parts/catalog.js";
import { field, h, select, set, throttle } from "/parts/dom.js";
import { count } from "/parts/format.js";
import { looks, markerIcon, split } from "/parts/looks.js";
import { readQuery, writeQuery } from "/parts/query.js";
import { frontTable, scatter } from "/parts/scatter.js";
import { wantsLog } from "/parts/scales.js";
import { empty, loading } from "/parts/states.js";
import { hideTip } from "/parts/tooltip.js";

const LIVE_MS = 6000;
// More scenes than this at once would be more ink than insight.
const ALL_AT_ONCE = 6;

/** Choices, legend and a chart for every scene. */
export async function mount(panel, study) {
  const { signal } = study;
  const { scenes } = study.detail;
  // Names alone would not say what is less and better.
  const catalog = await metricCatalog();
  if (signal.aborted) return null;
  // Of rates more is better: their front would be that of the worst.
  const metrics = study.detail.metrics.filter((m) => catalog.get(m)?.better !== "more");
  const query = readQuery();
  const state = {
    x: metrics.includes(query.x) ? query.x : firstOf(metrics, "total_cull_ms", "cull_ms"),
    y: metrics.includes(query.y) ? query.y : firstOf(metrics, "mean_triangles", "over_submission"),
    xlog: query.xlog || "auto",
    ylog: query.ylog || "auto",
    scene: query.scene ?? (scenes.length > ALL_AT_ONCE ? scenes[0] : ""),
  };
  // Switched off in the legend; not in the address, since it is a way of looking.
  const off = { culling: new Set(), variant: new Set() };
  if (!state.x) {
    set(panel, empty("No values yet", h("p", null, "Fronts are drawn as soon as runs are finished.")));
    const live = throttle(() => study.reload(), LIVE_MS);
    return { live, destroy: live.cancel };
  }

  let answer = null;
  let charts = [];
  const legend = h("div", { class: "legend" });
  const body = h("div", null, loading("Loading the fronts"));
  // Choices live in the address; what is automatic leaves no trace there.
  const pick = (key, value) => {
    state[key] = value;
    writeQuery({
      x: state.x,
      y: state.y,
      xlog: state.xlog === "auto" ? null : state.xlog,
      ylog: state.ylog === "auto" ? null : state.ylog,
      scene: state.scene,
    });
  };
  // Automatic is logarithmic where values lie far apart.
  const scaleOptions = [
    ["auto", "automatic"],
    ["linear", "linear"],
    ["log", "logarithmic"],
  ];
  set(
    panel,
    h(
      "div",
      { class: "controls" },
      scenes.length > 1 &&
        field(
          "Scene",
          select(
            [["", "all scenes"], ...scenes.map((s) => [s, s])],
            state.scene,
            (v) => (pick("scene", v), load()),
          ),
        ),
      field(
        "Across",
        metricSelect(catalog, metrics, state.x, (v) => (pick("x", v), load())),
      ),
      field(
        "Up",
        metricSelect(catalog, metrics, state.y, (v) => (pick("y", v), load())),
      ),
      field(
        "Axis across",
        select(scaleOptions, state.xlog, (v) => (pick("xlog", v), draw())),
      ),
      field(
        "Axis up",
        select(scaleOptions, state.ylog, (v) => (pick("ylog", v), draw())),
      ),
    ),
    h(
      "p",
      { class: "hint" },
      "Less is better in both; the lower left is where everybody wants to be. Bars are 95 % intervals. Hollow: behind the front by less than the intervals can tell. Pale: dominated.",
    ),
    legend,
    body,
  );

  /** Asks for the fronts; quietly where they are only to be brought up to date. */
  async function load({ quiet = false } = {}) {
    if (!quiet) set(body, loading("Loading the fronts"));
    try {
      answer = await api.json(`${study.path}/front`, {
        query: { x: state.x, y: state.y, where: study.where, scene: state.scene },
        signal,
      });
      study.filterError(null);
      draw();
    } catch (error) {
      study.failed(body, error, () => load(), { quiet });
    }
  }

  const metricOf = (name) => ({ name, unit: catalog.get(name)?.unit });
  // One choice for all scenes, so that their charts can be compared.
  const isLog = (how, key) =>
    how === "auto" ? wantsLog(answer.scenes.flatMap((s) => s.points.map((p) => p[key].value))) : how === "log";

  /** Looks are those of the whole study: a filter must not change anybody’s colour. */
  function draw() {
    if (!answer) return;
    hideTip();
    // All scenes together: a method has the same look in each.
    const labels = answer.scenes.flatMap((s) => s.points.map((p) => p.label));
    if (labels.length === 0 && answer.scenes.every((s) => !s.left_out?.length)) {
      set(legend);
      return set(body, empty(study.where ? "No run matches the filter" : "No run has both values yet"));
    }
    const style = looks(study.detail.combinations.length ? study.detail.combinations : labels);
    const log = { x: isLog(state.xlog, "x"), y: isLog(state.ylog, "y") };
    const shown = [...new Set(labels)];
    drawLegend(looks(shown), style);
    const single = answer.scenes.length === 1;
    charts = [];
    set(
      body,
      h(
        "div",
        { class: single ? "fronts single" : "fronts" },
        answer.scenes.map((s) => sceneCard(s, style, log, single)),
      ),
    );
    filter();
  }

  /** Chart, numbers and what is missing of one scene. */
  function sceneCard(scene, style, log, single) {
    const look = (p) => {
      const { variant, culling } = split(p.label);
      return { shape: style.shape(variant), colour: style.colour(culling) };
    };
    const address = (p) => `/studies/${segment(study.ref)}/runs/${p.ordinal}`;
    const chart = scatter({
      title: scene.scene,
      points: scene.points,
      x: metricOf(state.x),
      y: metricOf(state.y),
      log,
      look,
      width: single ? 960 : 560,
      onOpen: (p, event) =>
        event.ctrlKey || event.metaKey ? window.open(address(p), "_blank") : study.navigate(address(p)),
    });
    charts.push(chart);
    const onFront = scene.points.filter((p) => p.standing === "front").length;
    const numbers = h("details", { class: "box" }, h("summary", null, "The numbers"));
    numbers.addEventListener(
      "toggle",
      () =>
        numbers.children.length === 1 &&
        numbers.append(frontTable(scene, metricOf(state.x), metricOf(state.y), address)),
    );
    return h(
      "figure",
      { class: "card front" },
      h(
        "figcaption",
        null,
        h("b", null, scene.scene),
        h("span", { class: "muted" }, ` ${onFront} of ${count(scene.points.length, "run")} on the front`),
      ),
      scene.points.length
        ? h("div", { class: "scroll" }, chart.node)
        : empty("No run of this scene has both values"),
      chart.left > 0 &&
        h(
          "p",
          { class: "hint" },
          `${count(chart.left, "point")} at zero or below cannot stand on a logarithmic axis.`,
        ),
      scene.points.length > 0 && numbers,
      scene.left_out?.length > 0 &&
        h(
          "details",
          { class: "box" },
          h("summary", null, `Not drawn: ${scene.left_out.length}`),
          h(
            "ul",
            null,
            scene.left_out.map((l) => h("li", null, h("code", null, l.label), `: ${l.why}`)),
          ),
        ),
    );
  }

  /** Culling by colour, structure by shape, as in the report; every entry is a switch. */
  function drawLegend({ cullings, variants }, style) {
    const toggle = (kind, name, icon) => {
      const node = h(
        "button",
        {
          type: "button",
          class: "chip",
          "aria-pressed": !off[kind].has(name),
          title: "Show or fade; with Shift only this",
          onclick: (event) => switchOn(kind, name, event.shiftKey, kind === "culling" ? cullings : variants),
        },
        icon,
        name,
      );
      return node;
    };
    set(
      legend,
      h(
        "div",
        { role: "group", "aria-label": "Culling" },
        h("span", { class: "muted" }, "Culling "),
        cullings.map((c) => toggle("culling", c, markerIcon("circle", style.colour(c)))),
      ),
      h(
        "div",
        { role: "group", "aria-label": "Structure" },
        h("span", { class: "muted" }, "Structure "),
        variants.map((v) => toggle("variant", v, markerIcon(style.shape(v), "var(--ink)"))),
      ),
    );
  }

  /** Shows or fades an entry; with Shift everything else, and with Shift again all. */
  function switchOn(kind, name, only, all) {
    const set_ = off[kind];
    if (only) {
      const alone = !set_.has(name) && set_.size === all.length - 1;
      set_.clear();
      if (!alone) for (const other of all) if (other !== name) set_.add(other);
    } else if (set_.has(name)) set_.delete(name);
    else set_.add(name);
    for (const b of legend.querySelectorAll("button")) {
      const group = b.closest("[role=group]").getAttribute("aria-label") === "Culling" ? "culling" : "variant";
      b.setAttribute("aria-pressed", !off[group].has(b.lastChild.textContent));
    }
    filter();
  }

  /** Fades points rather than taking them away: the front stays what it is. */
  function filter() {
    const isOn = (p) => {
      const { variant, culling } = split(p.label);
      return !off.culling.has(culling) && !off.variant.has(variant);
    };
    for (const chart of charts) chart.filter(isOn);
  }

  load();
  const live = throttle(async () => {
    if (!(await study.grown().catch(() => false))) load({ quiet: true });
    else if (!signal.aborted) study.reopen();
  }, LIVE_MS);
  return {
    refilter: () => load(),
    live,
    destroy() {
      live.cancel();
      hideTip();
    },
  };
}
