// Published statements of a study, and whether it reproduces them.

import { api } from "/api.js";
import { h, throttle } from "/parts/dom.js";
import { capital, interval, missing } from "/parts/format.js";
import { empty, guarded } from "/parts/states.js";

const LIVE_MS = 8000;
// So many claims fit on a screen with all that was found.
const FEW = 3;
// The verdicts as classes of the style sheet; another word is shown as it is.
const CLASSES = [
  [/contradict/i, "contradicted"],
  [/model/i, "model"],
  [/reproduced/i, "reproduced"],
];

/** Judged by the server at every look: while runs come in, verdicts may still change. */
export async function mount(panel, { path, signal }) {
  const load = () =>
    guarded(panel, "Judging the claims", async () => {
      const { items } = await api.json(`${path}/claims`, { signal });
      if (items.length === 0) {
        return empty(
          "The manifest makes no claims",
          h(
            "p",
            null,
            "A ",
            h("code", null, "[[claim]]"),
            " states what a paper says; here stands whether this study says the same.",
          ),
        );
      }
      const verdicts = new Map();
      for (const c of items) verdicts.set(c.verdict, (verdicts.get(c.verdict) || 0) + 1);
      return [
        h("p", { class: "muted" }, [...verdicts].map(([v, n]) => `${n} ${v.replace("_", " ")}`).join(", ")),
        h("ul", { class: "claims" }, items.map((c) => claim(c, items.length <= FEW))),
      ];
    });
  load();
  const live = throttle(load, LIVE_MS);
  return { live, destroy: () => live.cancel() };
}

// The class of the style sheet; the word itself is shown as it came.
const kindOf = (verdict) => CLASSES.find(([pattern]) => pattern.test(verdict))?.[1] || "undecided";

/** What was stated and found in each scene, or whatever the claim is judged by. */
function groups(list, open) {
  if (!list?.length) return null;
  const cells = (g) => [
    h("th", { scope: "row" }, g.name || "all"),
    h("td", null, g.stated || missing("not stated")),
    h("td", { class: "n" }, g.found ? interval(g.found) : missing("not found")),
    h("td", { class: "nowrap" }, h("span", { class: `badge ${kindOf(g.verdict)} small` }, g.verdict)),
    h("td", null, g.note || ""),
  ];
  const head = ["where", "stated", "found", "verdict", "note"].map((t, i) =>
    h("th", { scope: "col", class: i === 2 ? "n" : null }, t),
  );
  return h(
    "details",
    { class: "box", open },
    h("summary", null, `Place by place (${list.length})`),
    h(
      "div",
      { class: "scroll" },
      h(
        "table",
        null,
        h("caption", { class: "offscreen" }, "The claim place by place"),
        h("thead", null, h("tr", null, head)),
        h(
          "tbody",
          null,
          list.map((g) => h("tr", null, cells(g))),
        ),
      ),
    ),
  );
}

/** Verdict first, then what was claimed, by whom, and what was found. */
function claim(c, open) {
  const kind = kindOf(c.verdict);
  return h(
    "li",
    { class: "card" },
    h("p", null, h("span", { class: `badge ${kind}` }, c.verdict.replace("_", " ")), " ", h("b", null, c.text)),
    h(
      "p",
      { class: "muted" },
      h("code", null, c.id),
      c.source && `, ${c.source}`,
      c.summary && `. ${capital(c.summary)}`,
    ),
    groups(c.groups, open),
  );
}
