// Scales of charts: linear and logarithmic axes with round ticks, and the colours of
// heat maps, which stay in order for every kind of colour vision and in grey.

// After ColorBrewer's YlGnBu (Brewer 2003): pale yellow to deep blue, even in lightness.
const STOPS = [
  [255, 249, 214],
  [214, 239, 179],
  [142, 211, 186],
  [72, 183, 196],
  [33, 143, 191],
  [34, 94, 168],
  [12, 44, 104],
];
const STEPS = 256;

/** 256 colours, little to much. On paper little is pale, on a dark page little is dark. */
export function ramp(dark) {
  const colours = [];
  for (let i = 0; i < STEPS; i += 1) {
    const at = (dark ? STEPS - 1 - i : i) / (STEPS - 1);
    const k = Math.min(STOPS.length - 2, Math.floor(at * (STOPS.length - 1)));
    const t = at * (STOPS.length - 1) - k;
    const rgb = STOPS[k].map((c, j) => Math.round(c + (STOPS[k + 1][j] - c) * t));
    const light =
      0.2126 * (rgb[0] / 255) ** 2.2 + 0.7152 * (rgb[1] / 255) ** 2.2 + 0.0722 * (rgb[2] / 255) ** 2.2;
    // The ink that has the greater contrast on this colour.
    colours.push({ fill: `rgb(${rgb.join(",")})`, ink: light > 0.18 ? "#000000" : "#ffffff" });
  }
  return colours;
}

/** Smallest and greatest finite value; for a logarithm of those above zero. */
export function extent(values, log = false) {
  let low = Infinity;
  let high = -Infinity;
  for (const v of values) {
    if (typeof v !== "number" || !Number.isFinite(v) || (log && v <= 0)) continue;
    if (v < low) low = v;
    if (v > high) high = v;
  }
  return low <= high ? [low, high] : null;
}

/** Whether a logarithm shows more: all above zero, and more than a factor of thirty apart. */
export function wantsLog(values) {
  const all = extent(values);
  return Boolean(all) && all[0] > 0 && all[1] / all[0] > 30;
}

/** Share of the way from low to high, 0 to 1. */
export function share(value, [low, high], log) {
  if (low === high) return 0.5;
  if (log) return value <= 0 ? 0 : clamp01(Math.log(value / low) / Math.log(high / low));
  return clamp01((value - low) / (high - low));
}
const clamp01 = (x) => Math.max(0, Math.min(1, x));

/** An axis: `at(value)` in pixels, `value(pixel)`, ticks. The domain is widened a little. */
export function axis(domain, [from, to], { log = false, pad = 0.04, zero = false } = {}) {
  let [low, high] = domain || (log ? [1, 10] : [0, 1]);
  if (log) {
    const room = Math.max(Math.log(high / low) * pad, 0.02);
    [low, high] = [low * Math.exp(-room), high * Math.exp(room)];
  } else {
    // What never changes gets room for ticks around it.
    const room = high > low ? (high - low) * pad : pad && (Math.abs(high) / 4 || 1);
    high += room;
    low = zero && low >= 0 && low < high * 0.35 ? 0 : low - room;
  }
  const span = log ? Math.log(high / low) : high - low;
  return {
    low,
    high,
    log,
    at: (v) => from + ((log ? Math.log(Math.max(v, low * 1e-3) / low) : v - low) / span) * (to - from),
    value: (p) =>
      log ? low * Math.exp(((p - from) / (to - from)) * span) : low + ((p - from) / (to - from)) * span,
    ticks: (most) => (log ? logTicks(low, high, most) : linearTicks(low, high, most)),
  };
}

/** Round numbers, at most about `most` of them. */
export function linearTicks(low, high, most = 6) {
  const raw = (high - low) / Math.max(1, most);
  const power = 10 ** Math.floor(Math.log10(raw || 1));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= raw) || power;
  const out = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + step * 1e-9 && out.length < 100; i += 1) {
    out.push(Number((i * step).toPrecision(12)));
  }
  return out;
}

export function logTicks(low, high, most = 6) {
  const decades = Math.log10(high / low);
  // Less than a decade: round linear ticks tell more.
  if (decades < 0.8) return linearTicks(low, high, most).filter((t) => t > 0);
  const steps = decades > most ? [1] : decades * 3 > most * 1.5 ? [1, 3] : [1, 2, 5];
  const skip = Math.max(1, Math.ceil(decades / most));
  const out = [];
  for (let e = Math.floor(Math.log10(low)); e <= Math.log10(high); e += 1) {
    if (e % skip) continue;
    for (const s of steps) {
      const t = Number((s * 10 ** e).toPrecision(12));
      if (t >= low && t <= high) out.push(t);
    }
  }
  return out;
}
