// Long tables: a real <table> in a scrolling box, of which only the rows in view exist.
// Rows above and below are two empty rows of the right height.

import { h, onceAFrame } from "/parts/dom.js";

const AROUND = 12;

/**
 * `row(i)` makes the cells' <tr>; `onNearEnd()` asks for more. All rows have the height
 * `rowHeight`, which the style sheet must keep (class "fixed").
 */
export function virtualTable({
  head,
  caption,
  label,
  row,
  rowHeight = 31,
  height = "68vh",
  onNearEnd = () => {},
}) {
  const above = h("tr", { "aria-hidden": "true", class: "spacer" }, h("td"));
  const below = h("tr", { "aria-hidden": "true", class: "spacer" }, h("td"));
  const body = h("tbody", null, above, below);
  const table = h("table", { class: "fixed" }, h("caption", { class: "offscreen" }, caption), head, body);
  const box = h(
    "div",
    { class: "rows", tabindex: 0, role: "region", "aria-label": label, style: { "max-height": height } },
    table,
  );
  let total = 0;
  let from = 0;
  let to = 0;

  function draw(force) {
    const first = Math.max(0, Math.floor(box.scrollTop / rowHeight) - AROUND);
    const last = Math.min(total, Math.ceil((box.scrollTop + (box.clientHeight || 600)) / rowHeight) + AROUND);
    if (force || first !== from || last !== to) {
      const nodes = [];
      const columns = head.querySelectorAll("th").length;
      // Rows that stay keep their nodes, and with them focus and selection.
      const kept = new Map();
      if (!force)
        for (const node of body.children) if (node.dataset.index) kept.set(Number(node.dataset.index), node);
      for (let i = first; i < last; i += 1) {
        let node = kept.get(i);
        if (!node) {
          node = row(i);
          node.dataset.index = i;
          node.setAttribute("aria-rowindex", i + 2);
        }
        nodes.push(node);
      }
      above.firstChild.colSpan = columns;
      below.firstChild.colSpan = columns;
      above.firstChild.style.height = `${first * rowHeight}px`;
      below.firstChild.style.height = `${(total - last) * rowHeight}px`;
      above.hidden = first === 0;
      below.hidden = last === total;
      body.replaceChildren(above, ...nodes, below);
      [from, to] = [first, last];
    }
    if (box.scrollTop + box.clientHeight > (total - 40) * rowHeight) onNearEnd();
  }

  const soon = onceAFrame(() => draw(false));
  box.addEventListener("scroll", soon, { passive: true });
  // The box takes its height from its first rows, and the window may change it later.
  // The observer goes with the box; nothing else holds it.
  new ResizeObserver(soon).observe(box);
  return {
    node: box,
    table,
    body,
    /** Tells how many rows there are now; `known` is how many there will be. */
    resize(rows, known = rows) {
      total = rows;
      table.setAttribute("aria-rowcount", known + 1);
      draw(true);
      // An empty box was as low as its head; now that it has rows it shows more of them.
      draw(false);
    },
    top() {
      box.scrollTop = 0;
    },
    redraw: () => draw(true),
  };
}
