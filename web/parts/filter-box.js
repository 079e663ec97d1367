// The box for `where`: the grammar of `cullmark query`. What the server says of a filter
// stands below it, and the names that may be used can be put in with a click.

import { debounce, h, set, uid } from "/parts/dom.js";

const AFTER_MS = 450;
const GRAMMAR =
  "structure = octree and depth >= 4; culling in (frustum, none) or not scene = nucleus; total_cull_ms in 1 .. 5; status = failed";

/**
 * What a refusal says of the filter, or null when it is about something else. Its detail
 * begins with `where`, and the lines after the first show the place.
 */
function aboutFilter(problem) {
  const mistake = problem.errors?.find((e) => e.key === "where");
  if (mistake) return mistake;
  const found = /^`where`:?\s*([^\n]*)\n?([\s\S]*)$/.exec(problem.detail || "");
  return found && { message: found[1], snippet: found[2], help: problem.help };
}

/** `onFilter(text)` once the text has been left alone for a moment, or on Enter. */
export function filterBox(fields, first, onFilter) {
  const errorId = uid("filter-error");
  const hintId = uid("filter-hint");
  const input = h("input", {
    type: "search",
    class: "mono filter-input",
    id: uid("filter"),
    value: first,
    spellcheck: "false",
    autocomplete: "off",
    autocapitalize: "off",
    placeholder: "structure = octree and depth >= 4",
    "aria-describedby": `${hintId} ${errorId}`,
    dataset: { filter: "" },
  });
  const error = h("div", { class: "filter-error", id: errorId, role: "alert" });
  let sent = first;
  // Said once, though typing, Enter and the cross of the field may all say it.
  const send = () => {
    later.cancel();
    if (input.value.trim() === sent) return;
    sent = input.value.trim();
    onFilter(sent);
  };
  const later = debounce(send, AFTER_MS);
  input.addEventListener("input", later);
  input.addEventListener("search", send);
  input.addEventListener("keydown", (event) => event.key === "Enter" && send());

  // A field at the caret, joined to what stands before it.
  const put = (name) => {
    const { selectionStart: at, value } = input;
    const before = value.slice(0, at);
    const gap = before && !/[\s(]$/.test(before) ? (/\b(and|or|not)\s*$/.test(before) ? " " : " and ") : "";
    input.setRangeText(`${gap}${name} `, at, input.selectionEnd, "end");
    input.focus();
    later();
  };
  const names = h("div", { class: "chips" });
  const help = h(
    "details",
    { class: "filter-help" },
    h("summary", null, "Fields and grammar"),
    h(
      "p",
      null,
      "Tests ",
      h("code", null, "field = value"),
      " with = != < <= > >=, ",
      h("code", null, "in (a, b)"),
      " and ",
      h("code", null, "in low .. high"),
      ", joined with ",
      h("code", null, "and"),
      ", ",
      h("code", null, "or"),
      ", ",
      h("code", null, "not"),
      " and brackets. Values with blanks stand in quotes. A run without the field matches no test of it.",
    ),
    h(
      "p",
      { class: "hint" },
      "Examples: ",
      GRAMMAR.split("; ").map((g, i) => [i ? ", " : "", h("code", null, g)]),
    ),
    names,
  );
  help.addEventListener("toggle", () => {
    if (help.open && names.children.length === 0)
      set(
        names,
        fields.map((f) => h("button", { type: "button", class: "chip", onclick: () => put(f) }, f)),
      );
  });

  const node = h(
    "div",
    { class: "filter-box" },
    h("div", { class: "filter-line" }, h("label", { for: input.id }, "Filter"), input, help),
    h("p", { class: "offscreen", id: hintId }, "Grammar of cullmark query; press Enter to apply"),
    error,
  );
  return {
    node,
    /** Shows a refusal that is about the filter and says whether it was. */
    fail(problem) {
      const shown = problem && aboutFilter(problem);
      input.setAttribute("aria-invalid", Boolean(shown));
      set(
        error,
        shown && [
          h("span", null, shown.message),
          shown.help && h("span", { class: "muted" }, ` ${shown.help}`),
          shown.snippet && h("pre", { class: "snippet" }, shown.snippet),
        ],
      );
      return Boolean(shown);
    },
  };
}
