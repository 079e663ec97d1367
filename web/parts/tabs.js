// Tabs after the ARIA pattern: arrow keys move, the chosen tab is in the address.

import { h, set, uid } from "/parts/dom.js";

/** `tabs` are `{id, label, title}`; `onSelect(id)` fills the panel. */
export function tabs(list, { label, onSelect }) {
  const panel = h("div", { role: "tabpanel", class: "tab-panel", id: uid("panel"), tabindex: -1 });
  const buttons = list.map((t) =>
    h(
      "button",
      {
        type: "button",
        role: "tab",
        id: uid("tab"),
        "aria-controls": panel.id,
        dataset: { tab: t.id },
        onclick: () => choose(t.id),
      },
      t.label,
    ),
  );
  const bar = h("div", { role: "tablist", "aria-label": label, class: "tab-list" }, buttons);
  let chosen = "";

  /** Shows a tab; choosing the one that is shown does nothing. */
  function choose(id, { focus = false } = {}) {
    const at = Math.max(
      0,
      list.findIndex((t) => t.id === id),
    );
    buttons.forEach((b, i) => {
      b.setAttribute("aria-selected", i === at);
      b.tabIndex = i === at ? 0 : -1;
    });
    if (focus) buttons[at].focus();
    panel.setAttribute("aria-labelledby", buttons[at].id);
    if (chosen === list[at].id) return;
    chosen = list[at].id;
    set(panel);
    onSelect(chosen);
  }

  // Arrows choose at once: panels are quick to show.
  bar.addEventListener("keydown", (event) => {
    const at = list.findIndex((t) => t.id === chosen);
    const to = { ArrowRight: at + 1, ArrowLeft: at - 1, Home: 0, End: list.length - 1 }[event.key];
    if (to === undefined) return;
    event.preventDefault();
    choose(list[(to + list.length) % list.length].id, { focus: true });
  });

  return {
    bar,
    panel,
    choose,
    /** Changes the text of a tab, such as a count. */
    relabel(id, text) {
      const b = buttons[list.findIndex((t) => t.id === id)];
      if (b.textContent !== text) b.textContent = text;
    },
  };
}
