// Numbers, times and sizes as people read them. The rules are those of the report:
// three significant digits, thin spaces between thousands, a real minus, – for missing.

import { h } from "/parts/dom.js";

const THIN = "\u202F";
export const MISSING = "–";

/** `0.0123`, `4.57`, `12 345`; whole numbers keep all their digits. */
export function number(x, digits = 3) {
  if (typeof x !== "number") return MISSING;
  if (!Number.isFinite(x)) return Number.isNaN(x) ? "n/a" : x > 0 ? "∞" : "−∞";
  if (x === 0) return "0";
  if (Number.isInteger(x) && Math.abs(x) < 1e8) return grouped(x.toFixed(0));
  const magnitude = Math.floor(Math.log10(Math.abs(x)));
  if (magnitude < -4 || magnitude >= 15) return scientific(x, digits);
  return grouped(x.toFixed(Math.max(0, digits - 1 - magnitude)));
}

function scientific(x, digits) {
  const [mantissa, exponent] = x.toExponential(digits - 1).split("e");
  return `${mantissa}·10^${exponent.replace("+", "")}`.replaceAll("-", "−");
}

/** Thin spaces between groups of three; four digits stay together. */
export function grouped(plain) {
  const sign = plain.startsWith("-") ? "−" : "";
  const [whole, fraction] = plain.replace("-", "").split(".");
  const digits = whole.length > 4 ? whole.replace(/\B(?=(\d{3})+$)/g, THIN) : whole;
  return sign + digits + (fraction ? `.${fraction}` : "");
}

/** Value, low and high of a cell; an exact number has no interval. */
export function parts(cell) {
  if (cell === null || cell === undefined) return null;
  if (typeof cell === "number") return { value: cell, low: cell, high: cell };
  if (typeof cell === "object" && typeof cell.value === "number") {
    return { value: cell.value, low: cell.low ?? cell.value, high: cell.high ?? cell.value };
  }
  return null;
}

/** `12.3 (12.1–12.6)`, all three with as many decimals as tell the ends apart. */
export function interval(cell) {
  const p = parts(cell);
  if (!p) return typeof cell === "string" ? cell : MISSING;
  if (p.low === p.high) return number(p.value);
  const texts = intervalTexts(p);
  return `${texts.value} (${texts.low}–${texts.high})`;
}

export function intervalTexts({ value, low, high }) {
  const size = Math.max(Math.abs(low), Math.abs(high));
  const ofSize = 2 - Math.floor(Math.log10(size || 1));
  const ofWidth = Math.ceil(-Math.log10(high - low || 1));
  const decimals = Math.max(0, Math.min(Math.max(ofSize, ofWidth), ofSize + 3));
  if (decimals > 8 || size >= 1e8) {
    return { value: number(value), low: number(low), high: number(high) };
  }
  const text = (x) => grouped(x.toFixed(decimals));
  return { value: text(value), low: text(low), high: text(high) };
}

/** A short text for ticks: `0.5`, `20`, `1.5k`, `2M`. */
export function tick(x) {
  const a = Math.abs(x);
  if (x !== 0 && a < 1e-3) return x.toExponential().replace("-", "−").replace("+", "");
  const [scale, suffix] = a >= 1e9 ? [1e9, "G"] : a >= 1e6 ? [1e6, "M"] : a >= 1e4 ? [1e3, "k"] : [1, ""];
  return `${parseFloat((x / scale).toPrecision(6))}`.replace("-", "−") + suffix;
}

/** `1.2 s`, `4 min 10 s`, `3 h 5 min`. */
export function duration(seconds) {
  if (typeof seconds !== "number" || !Number.isFinite(seconds)) return MISSING;
  if (seconds < 10) return `${number(seconds, 2)} s`;
  const s = Math.round(seconds);
  if (s < 60) return `${s} s`;
  if (s < 3600) return joined([Math.floor(s / 60), "min"], [s % 60, "s"]);
  if (s < 86400) return joined([Math.floor(s / 3600), "h"], [Math.round((s % 3600) / 60), "min"]);
  return joined([Math.floor(s / 86400), "d"], [Math.round((s % 86400) / 3600), "h"]);
}
const joined = ([a, unit], [b, less]) => `${a} ${unit}` + (b ? ` ${b} ${less}` : "");

export function bytes(n) {
  if (typeof n !== "number") return MISSING;
  if (n < 1024) return `${n} B`;
  const units = ["KiB", "MiB", "GiB", "TiB"];
  let i = -1;
  do {
    n /= 1024;
    i += 1;
  } while (n >= 1024 && i < units.length - 1);
  return `${number(n)} ${units[i]}`;
}

/** `12 runs`, `1 run`. */
export const count = (n, one, many = `${one}s`) => `${number(n)} ${n === 1 ? one : many}`;

/** "5 min ago", with the full instant in the title. */
export function instant(text) {
  const then = Date.parse(text);
  if (!text || Number.isNaN(then)) return missing("not known");
  const full = `${new Date(then).toLocaleString("en-GB", { dateStyle: "medium", timeStyle: "medium" })} here; ${text} UTC`;
  return h("time", { datetime: text, title: full }, ago(then));
}

function ago(then) {
  const s = (Date.now() - then) / 1000;
  if (s < 45) return "just now";
  if (s < 3600) return `${Math.max(1, Math.round(s / 60))} min ago`;
  if (s < 86400) return `${Math.round(s / 3600)} h ago`;
  if (s < 14 * 86400) return count(Math.round(s / 86400), "day") + " ago";
  return new Date(then).toISOString().slice(0, 10);
}

/** – with the reason in its title. */
export const missing = (why = "no value") => h("span", { class: "missing", title: why }, MISSING);

/** A cell of the API as nodes: text, number, or value with its interval. */
export function cellNode(cell, why) {
  if (typeof cell === "string") return cell === "" ? missing(why) : cell;
  const p = parts(cell);
  if (!p) return missing(why);
  if (p.low === p.high) return number(p.value);
  const t = intervalTexts(p);
  return [t.value, h("span", { class: "ci" }, ` (${t.low}–${t.high})`)];
}

/** "3 × 5 things", capital first. */
export const capital = (text) => text.charAt(0).toUpperCase() + text.slice(1);

/** Metric name as words: `total_cull_ms` stays recognisable, the unit goes apart. */
export const withUnit = (name, unit) => (unit ? `${name} (${unit})` : name);
