// Names and values of an object that the server describes more of than this page knows:
// environments, policies, parameters.

import { h } from "/parts/dom.js";
import { grouped } from "/parts/format.js";

/** Names and values of any object; objects inside become lists of their own. */
export function pairs(object) {
  const rows = Object.entries(object).map(([key, value]) => [
    h("dt", null, nameOf(key)),
    h(
      "dd",
      null,
      value !== null && typeof value === "object" && !Array.isArray(value) && Object.keys(value).length
        ? pairs(value)
        : valueText(value),
    ),
  ]);
  return h("dl", { class: "pairs" }, rows);
}

// Names of the server end in their unit, as `timeout_s` does.
const UNITS = { s: "s", ms: "ms", ns: "ns", us: "µs", m: "m", mib: "MiB", deg: "°", px: "px" };
const nameOf = (key) => {
  const words = key.split("_");
  const unit = words.length > 1 && UNITS[words.at(-1)];
  if (!unit) return words.join(" ");
  return `${words.slice(0, -1).join(" ")} (${unit})`;
};

/** Any value as text. */
export function valueText(value) {
  if (value === null || value === undefined || value === "") return "–";
  if (typeof value === "number")
    return Number.isInteger(value) ? grouped(String(value)) : String(Number(value.toPrecision(6)));
  if (Array.isArray(value)) return value.map(valueText).join(", ") || "–";
  if (typeof value === "object") return JSON.stringify(value);
  return String(value);
}
