// A new study: the manifest on the left, what it would run on the right, checked by the
// server as it is typed. A draft survives a reload.

import { api, isAbort, segment } from "/api.js";
import { notice } from "/parts/dialog.js";
import { button, debounce, field, h, pageHead, select, set } from "/parts/dom.js";
import { editor } from "/parts/editor.js";
import { count, duration } from "/parts/format.js";
import { planLegend, planView } from "/parts/plan.js";
import { readQuery } from "/parts/query.js";
import { watchSession, whyNot } from "/parts/session.js";
import { empty, keyed, loading, problem } from "/parts/states.js";

const DRAFT = "cullmark.draft";
const CHECK_AFTER_MS = 500;

// Small enough to read at a glance, and valid as it stands.
const SKELETON = `# What to measure. Ctrl+Enter submits.

extends = "presets/base.toml"

[study]
name = "my-study"

[[scene]]
name = "nucleus"
generate = "arena:map=nucleus"

[[path]]
name = "walk"
generate = "walk:frames=600,seed=7"

[matrix]
structure = ["list", "octree:depth=4"]
culling = ["none", "frustum"]
`;

/** Manifest left, plan right; one below the other where there is no room. */
export function mount(root, { signal, navigate, setTitle }) {
  setTitle("New study");
  let checking = null;
  let plan = null;
  // What the last answer of the server was about; an older answer says nothing.
  let checked = "";

  const ed = editor({ label: "Manifest (TOML)", onChange: edited, onSubmit: submit });
  const overrides = h("textarea", {
    rows: 2,
    spellcheck: "false",
    class: "mono",
    placeholder: "measure.repeats=3",
  });
  const priority = h("input", { type: "number", min: -100, max: 100, step: 1, value: 0 });
  const number = h("input", {
    type: "number",
    min: 0,
    step: 1,
    value: 0,
    "aria-label": "Number of the series",
    hidden: true,
  });
  const series = select(
    [
      ["", "0, the first (what is measured is skipped)"],
      ["next", "the next (measure everything anew)"],
      ["n", "number …"],
    ],
    "",
    () => {
      number.hidden = series.value !== "n";
      check();
    },
    // Its label stands for two controls, of which only one is always there.
    { "aria-label": "Series" },
  );
  const retry = h("input", { type: "checkbox" });
  const examples = h("select", { class: "examples", "aria-label": "Load an example" }, h("option", { value: "" }, "Examples …"));
  const verdict = h("p", { class: "verdict", role: "status" });
  const mistakes = h("div", { class: "mistakes" });
  const preview = h(
    "div",
    { class: "preview" },
    empty("The plan appears here", h("p", null, "Write a manifest, or take an example.")),
  );
  const go = h("span", null);

  set(
    root,
    pageHead(
      "New study",
      "Scenes, structures, culling tests, and how often each is measured. Checked as you type; nothing runs until you submit.",
      examples,
      go,
    ),
    h(
      "div",
      { class: "submit" },
      h(
        "section",
        { "aria-label": "Manifest", class: "submit-left" },
        ed.node,
        verdict,
        mistakes,
        h(
          "div",
          { class: "card options" },
          field("Overrides, one a line: key=value laid over the manifest", overrides, {
            wide: true,
            hint: "As --set of the command line: path.walk.generate=walk:frames=100",
          }),
          h(
            "div",
            { class: "controls" },
            field("Series", h("span", { class: "inline" }, series, number)),
            field("Priority, −100 to 100", priority),
            h("label", { class: "check" }, retry, "Retry runs that failed before"),
          ),
        ),
        h(
          "details",
          { class: "box" },
          h("summary", null, "Where scenes and paths come from"),
          h(
            "p",
            null,
            "Generated: ",
            h("code", null, 'generate = "arena:map=nucleus"'),
            ". Uploaded on the page ",
            h("a", { href: "/scenes" }, "Scenes"),
            ": ",
            h("code", null, 'file = "upload:hall.glb"'),
            " is the latest of that name, ",
            h("code", null, 'file = "upload:<id>"'),
            " one of them for ever. Other files must lie in the folder that the server allows; relative names start there.",
          ),
        ),
      ),
      h(
        "section",
        { "aria-label": "Plan", class: "card submit-right" },
        h("h2", null, "Plan"),
        preview,
        planLegend(),
      ),
    ),
  );

  const later = debounce(check, CHECK_AFTER_MS);
  for (const input of [overrides, priority, number]) input.addEventListener("input", later);
  retry.addEventListener("change", check);
  examples.addEventListener("change", takeExample);
  watchSession(drawButton, signal);
  start();

  /** The button says what it waits for. */
  function drawButton() {
    const why = whyNot("submit") || (plan ? null : "The manifest has no valid plan yet.");
    set(go, button("Submit", submit, { class: "primary", why }));
  }

  /** What is edited first: the manifest of another study, the draft, or a skeleton. */
  async function start() {
    loadExamples();
    const { from } = readQuery();
    if (from) {
      try {
        return ed.replace(await api.text(`/studies/${segment(from)}/manifest`, { signal }));
      } catch (error) {
        if (isAbort(error)) return;
        notice(`The manifest of ${from} could not be read: ${error.detail || error.title}`, { bad: true });
      }
    }
    ed.replace(draft() || SKELETON);
  }

  /** Fills the menu of examples. */
  async function loadExamples() {
    try {
      const { items } = await api.json("/examples", { signal });
      for (const [i, item] of items.entries())
        examples.append(h("option", { value: i }, item.title ? `${item.name}: ${item.title}` : item.name));
      examples.items = items;
      examples.disabled = items.length === 0;
    } catch (error) {
      // The page works without them.
      if (!isAbort(error)) examples.disabled = true;
    }
  }

  /** Puts an example into the editor; undo brings the text before back where the browser can. */
  function takeExample() {
    const item = examples.items?.[examples.value];
    examples.value = "";
    if (!item) return;
    ed.replace(item.manifest);
    ed.focus();
  }

  /** Keeps a draft and has it checked once the typing stops. */
  function edited(text) {
    try {
      localStorage.setItem(DRAFT, text);
    } catch {
      // No draft then.
    }
    later();
  }

  /** What is sent, for checking and for submitting alike. */
  function body(more) {
    const n = series.value === "n" ? Number(number.value) : series.value || null;
    const set_ = overrides.value
      .split("\n")
      .map((l) => l.trim())
      .filter(Boolean);
    return {
      manifest: ed.text,
      set: set_,
      series: n,
      priority: Number(priority.value) || 0,
      retry_failed: retry.checked,
      ...more,
    };
  }

  /** Has the server check the text as it is now; an answer to an older text is dropped. */
  async function check() {
    later.cancel();
    checking?.abort();
    checking = new AbortController();
    const request = body({ validate_only: true });
    if (!request.manifest.trim()) return told(null, null);
    set(verdict, h("span", { class: "muted" }, "Checking …"));
    if (!plan && !preview.querySelector(".facts")) set(preview, loading("Planning"));
    try {
      const answer = await api.post("/studies", request, {
        signal: AbortSignal.any([checking.signal, signal]),
      });
      checked = JSON.stringify(request);
      told(answer, null);
    } catch (error) {
      if (!isAbort(error)) told(null, error);
    }
  }

  /** Shows what the server said: a plan, mistakes, or that it could not be asked. */
  function told(answer, error) {
    plan = answer?.plan || null;
    const list = error?.errors || [];
    ed.mark(list.filter(isOurs));
    set(mistakes);
    if (plan) {
      const { estimate_s: time, trials } = plan;
      set(
        verdict,
        h("span", { class: "badge good" }, h("span", { class: "mark", "aria-hidden": "true" }, "✓"), "valid"),
        ` Study ${plan.study}: ${trials ? `${count(trials, "trial")}, about ${duration(time)}` : "everything is measured already"}.`,
      );
      set(preview, planView(plan, answer.notes || []));
    } else if (error) {
      set(
        verdict,
        h(
          "span",
          { class: "badge bad" },
          h("span", { class: "mark", "aria-hidden": "true" }, "✕"),
          "not valid",
        ),
        ` ${list.length ? count(list.length, "mistake") : error.title}`,
      );
      set(mistakes, list.length ? mistakeList(list) : problem(error, check));
      set(
        preview,
        empty(
          "No plan",
          h(
            "p",
            null,
            list.length ? "The mistakes beside the manifest come first." : "The server could not make one.",
          ),
        ),
      );
    } else {
      set(verdict);
      set(preview, empty("The manifest is empty"));
    }
    drawButton();
  }

  /** Mistakes as a list; those with a place move the caret there. */
  function mistakeList(list) {
    const item = (m) => {
      const place = m.line ? `Line ${m.line}` : m.key || "Manifest";
      const other = m.file && !isOurs(m) ? ` in ${m.file}` : "";
      return h(
        "li",
        null,
        isOurs(m)
          ? h(
              "button",
              { type: "button", class: "quiet place", onclick: () => ed.goTo(m.line, m.column || 1) },
              place,
            )
          : h("span", { class: "place" }, place + other),
        h(
          "span",
          null,
          m.line ? keyed(m) : m.message,
          m.help && h("span", { class: "muted" }, ` ${m.help}`),
          m.snippet && h("pre", { class: "snippet" }, m.snippet),
        ),
      );
    };
    return h("ul", { class: "mistake-list", "aria-label": "Mistakes" }, list.map(item));
  }

  /** Submits what the last check has seen, and goes to the study. */
  async function submit() {
    if (whyNot("submit")) return notice(whyNot("submit"));
    const request = body({ validate_only: false });
    // What is submitted has been seen: a plan of an older text is no plan.
    if (checked !== JSON.stringify({ ...request, validate_only: true })) await check();
    if (!plan) return notice("The manifest has mistakes; they are listed below it.", { bad: true });
    try {
      const answer = await api.post("/studies", request, { signal });
      for (const text of answer.notes || []) notice(typeof text === "string" ? text : text.message);
      notice(`${answer.study.ref} is submitted`);
      navigate(`/studies/${segment(answer.study.ref)}`);
    } catch (error) {
      if (!isAbort(error)) told(null, error);
    }
  }

  return () => {
    later.cancel();
    checking?.abort();
  };
}

/** A mistake at a line of this text, not in a preset or an override. */
const isOurs = (m) => m.line > 0 && (!m.file || /(^|\/)manifest(\.toml)?$/.test(m.file));

/** The text of last time, if there is any. */
function draft() {
  try {
    return localStorage.getItem(DRAFT);
  } catch {
    return null;
  }
}
