// The matrix of a study: scenes × combinations, coloured by any metric.

import { api, segment } from "/api.js";
import { firstOf, metricCatalog, metricSelect } from "/parts/catalog.js";
import { field, h, onceAFrame, select, set, setText, throttle } from "/parts/dom.js";
import { cellNode, interval, number, tick } from "/parts/format.js";
import { heatMap } from "/parts/heat.js";
import { heatData } from "/parts/heat-data.js";
import { readQuery, writeQuery } from "/parts/query.js";
import { axis, ramp, wantsLog } from "/parts/scales.js";
import { empty, loading } from "/parts/states.js";
import { badge } from "/parts/status.js";
import { hideTip, showTip, tipLine } from "/parts/tooltip.js";
import { watchTheme } from "/parts/theme.js";

// A finished run changes one cell, but asking for all of them is dear in a large study.
const SOON_MS = 3000;
const LATER_MS = 20000;
const LARGE = 5000;
const DWELL_MS = 250;

/** Controls, legend, map; the map itself is in parts/heat.js. */
export async function mount(panel, study) {
  const { signal } = study;
  const query = readQuery();
  const state = {
    metric: study.detail.metrics.includes(query.metric)
      ? query.metric
      : firstOf(study.detail.metrics, "total_cull_ms", "mean_triangles"),
    scale: query.scale || "auto",
    turn: query.turn || "auto",
    relative: query.relative === "1",
  };
  const catalog = await metricCatalog();
  if (signal.aborted) return null;
  if (!state.metric) {
    set(panel, empty("No values yet", h("p", null, "The matrix is drawn as soon as a run is finished.")));
    const live = throttle(() => study.reload(), SOON_MS);
    return { live, destroy: live.cancel };
  }

  const details = new Map();
  let matrix = null;
  let data = null;
  let dwell = null;
  let over = -1;
  const said = h("p", { class: "offscreen", "aria-live": "polite" });
  const note = h("p", { class: "hint" });
  const legend = h("canvas", { class: "legend-bar", role: "img" });
  const row = h("div", { class: "legend-row" });
  const map = heatMap({
    label: "Matrix of runs. Arrow keys move, Enter opens the run.",
    onHover,
    onFocus: say,
    onOpen: open,
    signal,
  });
  const body = h("div", null, loading("Loading the matrix"));
  // Choices live in the address; what is automatic leaves no trace there.
  const pick = (key, value) => {
    state[key] = value;
    writeQuery({
      metric: state.metric,
      scale: state.scale === "auto" ? null : state.scale,
      turn: state.turn === "auto" ? null : state.turn,
      relative: state.relative,
    });
  };
  const relative = h("input", {
    type: "checkbox",
    checked: state.relative,
    onchange: () => (pick("relative", relative.checked), draw()),
  });
  set(
    panel,
    h(
      "div",
      { class: "controls" },
      field(
        "Metric",
        metricSelect(catalog, study.detail.metrics, state.metric, (v) => (pick("metric", v), load())),
      ),
      field(
        "Scale of colours",
        select(
          [
            ["auto", "automatic"],
            ["linear", "linear"],
            ["log", "logarithmic"],
          ],
          state.scale,
          (v) => (pick("scale", v), draw()),
        ),
      ),
      field(
        "Combinations",
        select(
          [
            ["auto", "automatic"],
            ["down", "down"],
            ["across", "across"],
          ],
          state.turn,
          (v) => (pick("turn", v), draw()),
        ),
      ),
      h(
        "label",
        { class: "check", title: "Each value beside the best of its scene: 1 is the best there" },
        relative,
        "relative to the best of the scene",
      ),
      h(
        "span",
        { class: "zoom", role: "group", "aria-label": "Size of cells" },
        zoomButton("−", 1 / 1.4, "Smaller cells"),
        zoomButton("1:1", 0, "Usual size"),
        zoomButton("+", 1.4, "Larger cells"),
      ),
    ),
    body,
    said,
  );

  function zoomButton(text, factor, title) {
    return h(
      "button",
      { type: "button", class: "small", title, "aria-label": title, onclick: () => map.zoomBy(factor) },
      text,
    );
  }

  /** Asks for the values of one metric; quietly while results come in. */
  async function load({ quiet = false } = {}) {
    if (!quiet) set(body, loading("Loading the matrix"));
    try {
      matrix = await api.json(`${study.path}/matrix`, {
        query: { metric: state.metric, where: study.where },
        signal,
      });
      study.filterError(null);
      details.clear();
      draw();
    } catch (error) {
      study.failed(body, error, () => load(), { quiet });
    }
  }

  /**
   * Puts the answer on the map. With more combinations than scenes these go down: their names are
   * long, and read better lying than slanted.
   */
  function draw() {
    if (!matrix) return;
    if (matrix.cells.ordinal.length === 0)
      return set(body, empty(study.where ? "No run matches the filter" : "The study has no runs"));
    const turned = state.turn === "auto" ? matrix.columns.length > matrix.rows.length : state.turn === "down";
    data = heatData(matrix, { turned, relative: state.relative, more: more() });
    const log = state.scale === "auto" ? wantsLog(data.values) : state.scale === "log";
    if (!map.node.isConnected) set(body, row, map.node, note);
    // Counts change while the study runs; the map itself stays, and with it the focus.
    set(row, legendRow());
    const colours = map.show(data, log);
    drawLegend(colours.domain, log);
    const m = catalog.get(state.metric);
    setText(
      note,
      `${state.metric}${m?.unit ? ` (${m.unit})` : ""}${m ? `: ${m.about}. ${m.kind === "modelled" ? "Modelled, not measured. " : ""}` : ". "}${best()}${zeros(log)}`,
    );
  }

  // Said only where it is the case.
  const more = () => catalog.get(state.metric)?.better === "more";
  const best = () =>
    !state.relative
      ? ""
      : more()
        ? "Shown as the greatest value of its scene over it: 1 is the best there. "
        : "Shown over the least value of its scene: 1 is the best there. ";
  const zeros = (log) =>
    log && data.values.some((v) => v !== null && v <= 0)
      ? "Zeros have the colour of the least value: a logarithm has no place for them."
      : "";

  // What the numbers of map and legend are in.
  const unitText = () => (state.relative ? "× the best of the scene" : catalog.get(state.metric)?.unit || "no unit");

  /** Colours, and the states that have none. */
  function legendRow() {
    const { counts } = data;
    const key = (status, text) =>
      counts[status] > 0 &&
      h(
        "span",
        { class: "key" },
        h(
          "span",
          { class: `swatch ${status}`, "aria-hidden": "true" },
          { failed: "✕", wrong: "!" }[status] || "",
        ),
        `${text}: ${number(counts[status])}`,
      );
    return [
      legend,
      data.values.some((v) => v !== null) && h("span", { class: "muted" }, unitText()),
      key("pending", "pending"),
      key("failed", "failed"),
      key("wrong", "wrong"),
    ];
  }

  /** The ramp with ticks on the scale in use. */
  function drawLegend(domain, log) {
    const ratio = devicePixelRatio || 1;
    const [w, hgt] = [300, 34];
    legend.width = w * ratio;
    legend.height = hgt * ratio;
    legend.style.width = `${w}px`;
    legend.style.height = `${hgt}px`;
    const c = legend.getContext("2d");
    c.scale(ratio, ratio);
    legend.hidden = !domain;
    if (!domain) return;
    const colours = ramp(document.documentElement.dataset.theme === "dark");
    const [x0, x1] = [18, w - 18];
    for (let x = x0; x < x1; x += 1) {
      c.fillStyle = colours[Math.floor(((x - x0) / (x1 - x0)) * 255)].fill;
      c.fillRect(x, 2, 1.5, 12);
    }
    const style = getComputedStyle(document.documentElement);
    c.fillStyle = style.getPropertyValue("--muted");
    c.font = "11px Inter, system-ui, sans-serif";
    c.textAlign = "center";
    const scale = axis(domain, [x0, x1], { log, pad: 0 });
    const ticks = domain[0] === domain[1] ? [domain[0]] : scale.ticks(5);
    let right = -Infinity;
    for (const t of ticks.length > 1 ? ticks : domain) {
      const x = domain[0] === domain[1] ? (x0 + x1) / 2 : scale.at(t);
      const label = tick(Number(t.toPrecision(3)));
      const half = c.measureText(label).width / 2;
      if (x - half < right + 6 || x < x0 - 1 || x > x1 + 1) continue;
      c.fillRect(x, 14, 1, 4);
      c.fillText(label, x, 29);
      right = x + half;
    }
    legend.setAttribute(
      "aria-label",
      `Colours from ${number(domain[0])} to ${number(domain[1])}, ${log ? "logarithmic" : "linear"}`,
    );
  }

  /** The tooltip: what the matrix knows at once, interval and reason once the pointer rests. */
  function onHover(k, x, y) {
    if (k === over && k >= 0) return showTip(x, y, tip(k));
    over = k;
    clearTimeout(dwell);
    if (k < 0) return hideTip();
    showTip(x, y, tip(k));
    const { ordinal } = data.describe(k);
    if (details.has(ordinal)) return;
    dwell = setTimeout(async () => {
      try {
        details.set(ordinal, await api.json(`${study.path}/runs/${ordinal}`, { signal }));
      } catch {
        return; // The cell itself says enough.
      }
      if (over === k && !document.querySelector(".tip")?.hidden) showTip(x, y, tip(k));
    }, DWELL_MS);
  }

  /** Everything known of a cell. */
  function tip(k) {
    const cell = data.describe(k);
    const run = details.get(cell.ordinal);
    const known = run?.metrics?.[state.metric];
    const unit = catalog.get(state.metric)?.unit;
    return [
      h("div", { class: "tip-title" }, cell.scene),
      h("div", null, h("code", null, cell.label)),
      tipLine(state.metric, [
        cellNode(known ?? cell.value, `no value: ${cell.status}`),
        cell.value !== null && unit ? ` ${unit}` : "",
      ]),
      data.relative && cell.shown !== null && tipLine(more() ? "the best over it" : "over the best", `${number(cell.shown)} ×`),
      h(
        "div",
        null,
        badge(cell.status, { small: true }),
        h("span", { class: "tip-muted" }, ` run ${cell.ordinal}`),
      ),
      run?.reason && h("div", { class: "tip-muted" }, run.reason),
    ];
  }

  /** The cell with the focus in words, for screen readers. */
  function say(k) {
    if (k < 0) return setText(said, "no run here");
    const cell = data.describe(k);
    const unit = catalog.get(state.metric)?.unit || "";
    setText(
      said,
      `${cell.scene}, ${cell.label}: ${cell.value === null ? "no value" : `${interval(cell.value)} ${unit}`}, ${cell.status}`,
    );
  }

  /** Opens the run of a cell; with Ctrl beside this page, as a link would. */
  function open(k, event) {
    const address = `/studies/${segment(study.ref)}/runs/${data.describe(k).ordinal}`;
    if (event && (event.ctrlKey || event.metaKey)) window.open(address, "_blank");
    else study.navigate(address);
  }

  watchTheme(onceAFrame(draw), signal);
  load();
  const large = study.detail.runs.total > LARGE;
  // The first runs bring metrics, and with them a better one to show than what there was.
  const follow = async () => {
    if (!(await study.grown().catch(() => false))) load({ quiet: true });
    else if (!signal.aborted) study.reopen();
  };
  const live = throttle(follow, large ? LATER_MS : SOON_MS);
  return {
    refilter: () => load(),
    live,
    destroy() {
      clearTimeout(dwell);
      live.cancel();
      hideTip();
    },
  };
}
