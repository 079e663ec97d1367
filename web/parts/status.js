// States of runs and studies: badges and progress bars. Every state differs by word and
// pattern as well as by colour.

import { h, set, setText } from "/parts/dom.js";
import { count, number } from "/parts/format.js";

/** Statuses by their number in a matrix. */
export const STATUSES = ["pending", "done", "failed", "wrong"];
export const MARKS = { pending: "…", done: "✓", failed: "✕", wrong: "!" };

const ABOUT = {
  pending: "not finished yet: trials are still to be made",
  done: "all trials accepted, and right for its class",
  failed: "crashed, timed out, ran out of memory, or counted differently between trials",
  wrong: "broke the promise of its declared class, so that its times are withheld",
};

/** `✕ failed` in its colour. */
export function badge(status, { small = false } = {}) {
  return h(
    "span",
    { class: `badge ${status}${small ? " small" : ""}`, title: `${status}: ${ABOUT[status] || status}` },
    h("span", { class: "mark", "aria-hidden": "true" }, MARKS[status] || "·"),
    status,
  );
}

/** What a worker does, as a noun. */
export const jobWord = (kind) => (kind === "judge" ? "judgement" : kind);

/** State of a study: active, paused, cancelled or finished. */
export function stateBadge(summary) {
  const state = summary.finished && summary.state === "active" ? "finished" : summary.state;
  return h("span", { class: `badge state-${state}` }, state);
}

const ORDER = ["done", "failed", "wrong", "pending"];

/** A bar of done, failed, wrong and pending with the counts under it; `.update(summary)`. */
export function progress(summary) {
  const segments = Object.fromEntries(ORDER.map((s) => [s, h("span", { class: `seg ${s}` })]));
  const bar = h("div", { class: "bar", role: "progressbar", "aria-valuemin": "0" }, Object.values(segments));
  const text = h("div", { class: "bar-text" });
  const node = h("div", { class: "progress" }, bar, text);
  node.update = (s) => {
    const { total } = s.runs;
    const ended = total - s.runs.pending;
    for (const status of ORDER) {
      segments[status].style.setProperty("flex-grow", s.runs[status]);
      segments[status].hidden = s.runs[status] === 0;
    }
    bar.setAttribute("aria-valuemax", total);
    bar.setAttribute("aria-valuenow", ended);
    bar.setAttribute("aria-valuetext", words(s.runs));
    bar.title = words(s.runs);
    const share = total ? Math.floor((100 * ended) / total) : 100;
    const others = ["failed", "wrong"].filter((k) => s.runs[k] > 0);
    const now = `${share} %|${s.runs.done}|${s.runs.failed}|${s.runs.wrong}|${total}`;
    if (node.dataset.now === now) return;
    node.dataset.now = now;
    set(
      text,
      h("span", { class: "share" }, s.runs.pending ? `${share} %` : "complete"),
      ` ${number(s.runs.done)} of ${count(total, "run")} done`,
      others.map((k) => [" · ", h("span", { class: `count ${k}` }, `${MARKS[k]} ${number(s.runs[k])} ${k}`)]),
    );
  };
  node.update(summary);
  return node;
}

// For the title and for screen readers: only what there is.
const words = (runs) =>
  ORDER.filter((s) => runs[s] > 0)
    .map((s) => `${number(runs[s])} ${s}`)
    .join(", ") || "no runs";

/** What is still to be done, in words. */
export function remaining(summary) {
  const { jobs } = summary;
  if (!jobs || (!jobs.trials && !jobs.judgements && !jobs.running))
    return summary.finished ? "nothing left to do" : "";
  const parts = [];
  if (jobs.trials) parts.push(count(jobs.trials, "trial"));
  if (jobs.judgements) parts.push(count(jobs.judgements, "judgement"));
  const left = parts.length ? `${parts.join(" and ")} left` : "";
  return [left, jobs.running ? `${number(jobs.running)} running now` : ""].filter(Boolean).join(", ");
}

/** A region that tells screen readers of progress, at most every ten seconds. */
export function announcer() {
  const node = h("p", { class: "offscreen", "aria-live": "polite" });
  let last = 0;
  node.say = (text) => {
    const now = Date.now();
    if (now - last < 10000) return;
    last = now;
    setText(node, text);
  };
  return node;
}
