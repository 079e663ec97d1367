// The editor of manifests: a textarea whose text is transparent, over the same text in
// colours. The textarea keeps what browsers do well: undo, selection, spelling off,
// input methods, screen readers.

import { h, set, setText, uid } from "/parts/dom.js";
import { keyed } from "/parts/states.js";
import { colourLine, lineNodes } from "/parts/toml.js";

const INDENT = 4;

/** `onChange(text)` on every edit, `onSubmit()` on Ctrl+Enter. */
export function editor({ label, onChange, onSubmit }) {
  const helpId = uid("help");
  const area = h("textarea", {
    class: "ed-area",
    spellcheck: "false",
    autocapitalize: "off",
    autocomplete: "off",
    wrap: "off",
    "aria-label": label,
    "aria-describedby": helpId,
  });
  const paint = h("div", { class: "ed-paint", "aria-hidden": "true" });
  const gutter = h("div", { class: "ed-gutter", "aria-hidden": "true" });
  const view = h("div", { class: "ed-view" }, gutter, h("div", { class: "ed-stack" }, paint, area));
  const status = h("p", { class: "ed-status" });
  const help = h(
    "p",
    { class: "offscreen", id: helpId },
    "Tab indents. Press Escape, then Tab, to leave the editor. Control and Enter submit.",
  );
  const node = h("div", { class: "editor" }, view, status, help);

  // What is painted: text and state of each line, so that only changed lines are redone.
  let painted = [];
  let mistakes = new Map();
  let leaving = false;

  /** Colours the lines that changed, or whose long strings opened or closed before them. */
  function repaint() {
    const lines = area.value.split("\n");
    let open = "";
    for (let i = 0; i < lines.length; i += 1) {
      const before = painted[i];
      if (before && before.text === lines[i] && before.openBefore === open) {
        open = before.openAfter;
        continue;
      }
      const coloured = colourLine(lines[i], open);
      const row = before?.row || h("div", { class: "ed-line" });
      set(row, lineNodes(coloured.pieces), lines[i] === "" ? "\u200B" : null);
      if (!before) {
        paint.append(row);
        gutter.append(h("div", { class: "ed-number" }, i + 1));
      }
      painted[i] = { text: lines[i], openBefore: open, openAfter: coloured.open, row };
      open = coloured.open;
    }
    for (let i = lines.length; i < painted.length; i += 1) {
      painted[i].row.remove();
      gutter.lastChild.remove();
    }
    painted.length = lines.length;
  }

  /** Marks in the text and beside it. */
  function markMistakes() {
    painted.forEach(({ row }, i) => {
      const here = mistakes.get(i + 1);
      row.classList.toggle("mistake", Boolean(here));
      const number = gutter.children[i];
      number.classList.toggle("mistake", Boolean(here));
      number.title = here ? here.map(keyed).join("\n") : "";
    });
    area.setAttribute("aria-invalid", mistakes.size > 0);
    tellPlace();
  }

  /** Line and column of the caret, from 1. */
  function place() {
    const before = area.value.slice(0, area.selectionStart);
    const line = before.split("\n").length;
    return { line, column: area.selectionStart - before.lastIndexOf("\n") };
  }

  /** Where the caret is, and what is wrong there. */
  function tellPlace() {
    const { line, column } = place();
    const here = mistakes.get(line);
    status.classList.toggle("alarm", Boolean(here));
    setText(
      status,
      `Line ${line}, column ${column}` +
        (here ? `: ${here.map((m) => keyed(m) + (m.help ? ` (${m.help})` : "")).join("; ")}` : ""),
    );
  }

  /** After every edit, whoever made it. */
  function changed() {
    repaint();
    tellPlace();
    onChange(area.value);
  }

  // execCommand, though old, is the one way to insert that undo takes back.
  function insert(text) {
    if (!document.execCommand("insertText", false, text)) {
      area.setRangeText(text, area.selectionStart, area.selectionEnd, "end");
      changed();
    }
  }

  /** Blanks to the next stop, or before every line of a selection. */
  function indent() {
    const { selectionStart: from, selectionEnd: to, value } = area;
    if (!value.slice(from, to).includes("\n")) {
      const column = from - (value.lastIndexOf("\n", from - 1) + 1);
      return insert(" ".repeat(INDENT - (column % INDENT)));
    }
    const start = value.lastIndexOf("\n", from - 1) + 1;
    area.setSelectionRange(start, to);
    const text = value.slice(start, to).replace(/^(?=.)/gm, " ".repeat(INDENT));
    insert(text);
    area.setSelectionRange(start, start + text.length);
  }

  area.addEventListener("keydown", (event) => {
    if (event.key === "Escape") {
      leaving = true;
      return setText(status, "Tab now leaves the editor");
    }
    if (event.key === "Tab" && !event.shiftKey && !leaving) {
      event.preventDefault();
      indent();
    } else if (event.key === "Enter" && (event.ctrlKey || event.metaKey)) {
      event.preventDefault();
      onSubmit();
    } else if (event.key === "Enter" && !event.shiftKey) {
      // The next line starts where this one does.
      const start = area.value.lastIndexOf("\n", area.selectionStart - 1) + 1;
      const blank = /^[ \t]*/.exec(area.value.slice(start, area.selectionStart))[0];
      if (blank) {
        event.preventDefault();
        insert(`\n${blank}`);
      }
    }
    if (!["Shift", "Tab"].includes(event.key)) leaving = false;
  });
  area.addEventListener("input", changed);
  area.addEventListener("blur", () => {
    leaving = false;
  });
  for (const what of ["keyup", "click", "select"]) area.addEventListener(what, () => leaving || tellPlace());
  repaint();

  return {
    node,
    get text() {
      return area.value;
    },
    /** Replaces the text; undo takes that back where the browser allows. */
    replace(text) {
      area.value = text;
      area.setSelectionRange(0, 0);
      mistakes = new Map();
      changed();
      markMistakes();
      view.scrollTop = 0;
      view.scrollLeft = 0;
    },
    /** Marks lines; a mistake without a line is shown by whoever calls. */
    mark(list) {
      mistakes = new Map();
      for (const m of list) if (m.line) mistakes.set(m.line, [...(mistakes.get(m.line) || []), m]);
      markMistakes();
    },
    /** Moves the caret and brings the line into view. */
    goTo(line, column = 1) {
      const lines = area.value.split("\n");
      const at =
        lines.slice(0, line - 1).reduce((sum, l) => sum + l.length + 1, 0) +
        Math.min(column - 1, (lines[line - 1] || "").length);
      area.focus({ preventScroll: true });
      area.setSelectionRange(at, at);
      const row = painted[line - 1]?.row;
      if (row) view.scrollTop = Math.max(0, row.offsetTop - view.clientHeight / 2);
      view.scrollLeft = 0;
      node.scrollIntoView({ block: "nearest" });
      tellPlace();
    },
    focus: () => area.focus(),
  };
}
