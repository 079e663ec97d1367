// Loading, empty and failed: every page that fetches shows one of these until it has data.

import { isAbort } from "/api.js";
import { h, set } from "/parts/dom.js";

export const loading = (what = "Loading") =>
  h(
    "div",
    { class: "state loading", role: "status" },
    h("span", { class: "spinner", "aria-hidden": "true" }),
    `${what} …`,
  );

/** Nothing there, and what to do about it. */
export const empty = (title, ...more) =>
  h("div", { class: "state empty" }, h("p", { class: "state-title" }, title), more);

/** A problem document as people read it: title, detail, help, and the list of mistakes. */
export function problem(error, retry, { heading = "p" } = {}) {
  return h(
    "div",
    { class: "state problem", role: "alert" },
    h(heading, { class: "state-title" }, error.title || "Something went wrong"),
    (error.detail || (!error.title && error.message)) && h("p", null, error.detail || error.message),
    error.help && h("p", { class: "muted" }, error.help),
    error.errors?.length > 0 &&
      h(
        "ul",
        null,
        error.errors.map((e) => h("li", null, mistakeText(e))),
      ),
    error.reload
      ? h("p", null, h("button", { type: "button", onclick: () => location.reload() }, "Load the page anew"))
      : retry && h("p", null, h("button", { type: "button", onclick: retry }, "Try again")),
  );
}

/** "measure.repeets: unknown key": messages leave out what the place says already. */
export const keyed = (mistake) => (mistake.key ? `${mistake.key}: ${mistake.message}` : mistake.message);

export function mistakeText(mistake) {
  const where = mistake.line
    ? `line ${mistake.line}${mistake.column ? `, column ${mistake.column}` : ""}: `
    : "";
  return where + keyed(mistake) + (mistake.help ? ` (${mistake.help})` : "");
}

/**
 * A module fetched on demand. Browsers remember that one could not be fetched, so that
 * only loading the page anew helps; the error says so.
 */
export async function fetchPart(load) {
  try {
    return await load();
  } catch (error) {
    throw Object.assign(new Error("", { cause: error }), {
      title: "A part of this page could not be loaded",
      detail: String(error.message || error),
      help: "The server may be down or have been replaced by another version.",
      reload: true,
    });
  }
}

/**
 * Runs `work` and shows its progress in `node`: loading, then what `work` returns, or
 * the problem with a button to try again. A whole page that failed has it as its `heading`.
 */
export async function guarded(node, what, work, { heading } = {}) {
  set(node, loading(what));
  try {
    const content = await work();
    if (content !== undefined) set(node, content);
    return true;
  } catch (error) {
    if (isAbort(error)) return false;
    if (!error.problem) console.error(error);
    set(
      node,
      problem(error, () => guarded(node, what, work, { heading }), { heading }),
    );
    return false;
  }
}
