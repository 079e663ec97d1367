// Every page in light, dark and narrow: pictures for people, and for machines what can be
// checked of accessibility without an outside tool.

import { join } from "node:path";
import { check, SHOTS, step } from "./harness.mjs";

const LOOKS = [
  { name: "light", theme: "light", width: 1360, height: 900 },
  { name: "dark", theme: "dark", width: 1360, height: 900 },
  { name: "narrow", theme: "light", width: 360, height: 740 },
];

/** Waits for whatever a page fetches, and for its pictures. */
export async function settle(page) {
  await page.waitForFunction(
    () => document.querySelector("main h1") && document.querySelector("#foot p") && !document.querySelector("main .state.loading:not(.paper *)") && (!document.querySelector(".cmv") || window.__viewer?.ready || document.querySelector(".cmv-error")),
    null,
    { timeout: 60000 },
  );
  await page.waitForFunction(() => [...document.images].every((i) => i.complete));
  // The plan comes a moment after the text.
  if (await page.locator(".ed-area").count()) await page.locator(".verdict .badge").waitFor();
  await page.waitForTimeout(150);
}

/** `pages` are `[name, address]`. */
export async function looks(page, address, pages) {
  for (const look of LOOKS) {
    await page.setViewportSize({ width: look.width, height: look.height });
    await page.goto(address);
    await page.evaluate((t) => localStorage.setItem("cullmark.theme", t), look.theme);
    for (const [name, path] of pages)
      await step(page, `${name}, ${look.name}`, async () => {
        await page.goto(address + path);
        await settle(page);
        await page.evaluate(() => document.activeElement?.blur());
        if (name.includes("charts")) await scrollThrough(page);
        await page.screenshot({ path: join(SHOTS, `${name}-${look.name}.png`), fullPage: !name.startsWith("viewer-") });
        check((await page.evaluate(() => document.documentElement.dataset.theme)) === look.theme, "the theme");
        const faults = await page.evaluate(faultsOfPage, look.width < 500);
        check(faults.length === 0, "accessibility", ...faults);
      });
  }
}

/** Charts are drawn when they come into view. */
async function scrollThrough(page) {
  // The page grows as they come, so its end is looked for at every step.
  for (let y = 0; y < (await page.evaluate(() => document.body.scrollHeight)); y += 500) {
    await page.evaluate((to) => scrollTo(0, to), y);
    await page.waitForTimeout(80);
  }
  await page.waitForFunction(() => document.querySelectorAll(".paper .loading").length === 0);
  await page.evaluate(() => scrollTo(0, 0));
}

/** Runs inside the page: names, labels, headings, ids, contrast, and nothing wider than the window. */
function faultsOfPage(narrow) {
  const faults = [];
  const visible = (n) => n.checkVisibility({ visibilityProperty: true, opacityProperty: true }) && n.getClientRects().length > 0;
  const short = (n) => n.outerHTML.replace(/\s+/g, " ").slice(0, 110);
  const text = (id) => document.getElementById(id)?.textContent.trim();
  const named = (n) =>
    n.getAttribute("aria-label")?.trim() ||
    (n.getAttribute("aria-labelledby") || "").split(/\s+/).map(text).join(" ").trim() ||
    [...(n.labels || [])].map((l) => l.textContent.trim()).join(" ") ||
    (n.matches("button, a, summary, [role=tab]") && (n.textContent.trim() || n.querySelector("img[alt]")?.alt)) ||
    n.title;
  for (const n of document.querySelectorAll("button, a[href], input, select, textarea, summary, [role=tab], [tabindex='0']"))
    if (visible(n) && n.type !== "hidden" && !named(n)) faults.push(`without a name: ${short(n)}`);
  for (const n of document.querySelectorAll("img, [role=img]"))
    if (visible(n) && !n.hasAttribute("alt") && !named(n)) faults.push(`picture without a text: ${short(n)}`);
  for (const n of document.querySelectorAll("[aria-describedby], [aria-labelledby], [aria-controls], label[for]"))
    for (const a of ["aria-describedby", "aria-labelledby", "aria-controls", "for"])
      for (const id of (n.getAttribute(a) || "").split(/\s+/).filter(Boolean))
        if (!document.getElementById(id)) faults.push(`${a} names ${id}, which is nowhere: ${short(n)}`);
  const ids = [...document.querySelectorAll("[id]")].map((n) => n.id);
  for (const id of new Set(ids.filter((id, i) => ids.indexOf(id) !== i))) faults.push(`the id ${id} is there twice`);
  const headings = [...document.querySelectorAll("h1, h2, h3, h4")].filter(visible);
  if (headings.filter((n) => n.tagName === "H1").length !== 1) faults.push("not exactly one h1");
  let last = 0;
  for (const n of headings) {
    const level = Number(n.tagName[1]);
    if (level > last + 1) faults.push(`h${level} after h${last}: ${n.textContent.slice(0, 40)}`);
    last = level;
  }
  for (const t of document.querySelectorAll("table")) if (visible(t) && !t.caption && !named(t) && !t.closest(".cmv")) faults.push(`table without a caption: ${short(t)}`);
  if (document.documentElement.scrollWidth > innerWidth + 1) {
    const wide = [...document.querySelectorAll("main *")].filter((n) => n.getBoundingClientRect().right > innerWidth + 1 && !n.closest(".offscreen"));
    faults.push(`wider than the window by ${document.documentElement.scrollWidth - innerWidth} px: ${wide.slice(0, 3).map(short).join(" | ")}`);
  }

  // Contrast of every text with what lies behind it, half-transparent layers blended. Any
  // colour of CSS becomes numbers by being painted.
  const pixel = new OffscreenCanvas(1, 1).getContext("2d", { willReadFrequently: true });
  const known = new Map();
  const colour = (css) => {
    if (!known.has(css)) {
      pixel.clearRect(0, 0, 1, 1);
      pixel.fillStyle = css;
      pixel.fillRect(0, 0, 1, 1);
      const [r, g, b, a] = pixel.getImageData(0, 0, 1, 1).data;
      known.set(css, [r, g, b, a / 255]);
    }
    return known.get(css);
  };
  const over = (top, below) => [0, 1, 2].map((k) => top[k] * top[3] + below[k] * (1 - top[3])).concat(1);
  const behind = (n) => {
    const layers = [];
    for (let m = n; m; m = m.parentElement) {
      const c = colour(getComputedStyle(m).backgroundColor);
      layers.push(c);
      if (c[3] === 1) break;
    }
    return layers.reverse().reduce((below, top) => over(top, below), colour(getComputedStyle(document.body).backgroundColor));
  };
  const light = (c) => {
    const [r, g, b] = c.map((x) => (x / 255 <= 0.04045 ? x / 255 / 12.92 : ((x / 255 + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const pale = new Set();
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const n = walker.currentNode.parentElement;
    if (!walker.currentNode.nodeValue.trim() || !visible(n) || n.closest("svg, .offscreen, :disabled, [aria-disabled=true], noscript")) continue;
    const style = getComputedStyle(n);
    const back = behind(n);
    let front = colour(style.color);
    if (front[3] === 0) continue; // The editor's text is painted by its twin.
    for (let m = n; m; m = m.parentElement) front = [...front.slice(0, 3), front[3] * Number(getComputedStyle(m).opacity)];
    const [a, b] = [light(over(front, back)), light(back)];
    const ratio = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
    const large = parseFloat(style.fontSize) >= 24 || (parseFloat(style.fontSize) >= 18.66 && Number(style.fontWeight) >= 700);
    if (ratio < (large ? 3 : 4.5) - 0.01) pale.add(`contrast ${ratio.toFixed(2)}: ${n.tagName.toLowerCase()}.${n.className} "${walker.currentNode.nodeValue.trim().slice(0, 30)}"`);
  }
  // Targets for fingers; links inside text are exempt.
  if (narrow)
    for (const n of document.querySelectorAll("button, select, summary, a.button")) {
      const box = n.getBoundingClientRect();
      if (visible(n) && box.height < 24 && !n.closest("p, th, td, li")) faults.push(`only ${Math.round(box.height)} px high: ${short(n)}`);
    }
  return [...faults, ...pale].slice(0, 20);
}
