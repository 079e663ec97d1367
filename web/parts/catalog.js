// The list of metrics with units and explanations: asked for once, used by every page.

import { api } from "/api.js";
import { h } from "/parts/dom.js";

let asked = null;

/** Metrics by name: `{name, unit, kind, about}`. A failure is not remembered. */
export function metricCatalog() {
  asked ??= api
    .json("/metrics")
    .then((list) => new Map(list.map((m) => [m.name, m])))
    .catch((error) => {
      asked = null;
      throw error;
    });
  return asked;
}

const KINDS = {
  measured: "Measured",
  modelled: "Modelled",
  counted: "Counted",
  judged: "Judged against the truth",
};
export const KIND_ORDER = Object.keys(KINDS);
export const kindName = (kind) => KINDS[kind] || kind;

/** A <select> of metrics in groups of their kind. */
export function metricSelect(catalog, names, value, onchange, attrs = {}) {
  const node = h("select", { ...attrs, onchange: () => onchange(node.value) });
  const rest = new Set(names);
  for (const kind of KIND_ORDER) {
    const group = names.filter((n) => catalog.get(n)?.kind === kind);
    if (group.length === 0) continue;
    node.append(
      h(
        "optgroup",
        { label: KINDS[kind] },
        group.map((n) => option(catalog, n, value)),
      ),
    );
    for (const n of group) rest.delete(n);
  }
  for (const n of rest) node.append(option(catalog, n, value));
  return node;
}

/** The explanation is in the title. */
function option(catalog, name, value) {
  const m = catalog.get(name);
  return h(
    "option",
    { value: name, selected: name === value, title: m?.about },
    m?.unit ? `${name} (${m.unit})` : name,
  );
}

/** The first of `wanted` that there is, else the first at all. */
export const firstOf = (names, ...wanted) => wanted.find((w) => names.includes(w)) || names[0] || "";
