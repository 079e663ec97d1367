// From an empty database to a finished study, its results, the keyboard, and a comparison
// with itself measured again.

import { readFileSync } from "node:fs";
import { ask, check, step, until } from "./harness.mjs";
import { settle } from "./looks.mjs";

const TINY = readFileSync(new URL("../../experiments/tiny.toml", import.meta.url), "utf8");
// Small, with two methods that may lose triangles, and a path that its frames can be told by.
const SMALL = [
  "study.title=Tiny: does culling pay at all?",
  "measure.repeats=2",
  "path.walk.generate=walk:frames=24,seed=7",
];
const MANIFEST = TINY.replace('"frustum+back_face"]', '"frustum+back_face", "frustum+octant_mask", "look_at"]');

const tab = (page, name) => page.getByRole("tab", { name }).click();
export const finished = (page) => page.locator(".badge.state-finished").waitFor({ timeout: 60000 });

/** Submits through the page as a person does; waits for the study's page. */
export async function submit(page, manifest, overrides, name) {
  await page.getByRole("textbox", { name: "Manifest (TOML)" }).fill(manifest);
  await page.locator(".options textarea").fill(overrides.join("\n"));
  await until("a plan", async () => (await page.locator(".verdict").innerText()).includes(`Study ${name}:`));
  await page.getByRole("button", { name: "Submit" }).click();
  await page.waitForURL(`**/studies/${name}@*`);
}

export async function studySteps(page, address) {
  await step(page, "an empty database invites to the first study", async () => {
    await page.goto(address);
    await page.getByText("No studies yet").waitFor();
    await page.getByRole("link", { name: "Submit the first study" }).click();
    await page.getByRole("heading", { name: "New study" }).waitFor();
  });

  await step(page, "a mistake has a marker at its line, and a plan comes once it is put right", async () => {
    page.expectComplaint(/422 POST .*\/studies$/);
    const wrong = MANIFEST.replace('"octree:depth=4"', '"octtree:depth=4"');
    const line = wrong.split("\n").findIndex((l) => l.includes("octtree")) + 1;
    const editor = page.getByRole("textbox", { name: "Manifest (TOML)" });
    await editor.fill(wrong);
    const mark = page.locator(".ed-number.mistake");
    await mark.waitFor();
    check((await mark.innerText()) === String(line), "the line of the mistake", await mark.innerText(), line);
    const list = page.getByRole("list", { name: "Mistakes" });
    check(/octree/.test(await list.innerText()), "a suggestion", await list.innerText());
    check((await page.getByRole("button", { name: "Submit" }).getAttribute("aria-disabled")) === "true", "no submitting with mistakes");
    await list.getByRole("button", { name: `Line ${line}` }).click();
    check(await editor.evaluate((n) => n === document.activeElement && n.value.slice(0, n.selectionStart).split("\n").length) === line, "the caret is there");
    await editor.fill(MANIFEST);
    await page.locator(".options textarea").fill(SMALL.join("\n"));
    await until("fifteen runs planned", async () => /\b15\b/.test(await page.locator(".submit-right .facts").innerText().catch(() => "")));
    check((await page.locator(".plan-cell.new").count()) === 15, "a cell a run");
    check((await mark.count()) === 0, "no marker any more");
  });

  await step(page, "the study is submitted and watched until it is finished", async () => {
    await submit(page, MANIFEST, SMALL, "tiny");
    check(page.url().endsWith("/studies/tiny@0"), "the study's address", page.url());
    // Live: the bar moves and the first values appear without a reload.
    await page.evaluate(() => (window.notReloaded = true));
    const done = async () => Number(/(\d+) of 15 runs done/.exec(await page.locator(".bar-text").innerText())?.[1]);
    await until("a first run", async () => (await done()) > 0, 60000);
    await finished(page);
    check((await done()) === 15, "all runs done", await done());
    check(await page.evaluate(() => window.notReloaded), "no reload in between");
  });

  await step(page, "the heat map shows the values of the API", async () => {
    const map = page.getByRole("application");
    await map.waitFor();
    const { cells, rows, columns } = await ask(page, "/studies/tiny@0/matrix?metric=total_cull_ms");
    check(cells.value.length === 15 && rows.length === 1 && columns.length === 15, "the matrix", cells.value.length, rows, columns);
    check(await page.locator("canvas.heat-canvas").evaluate(painted) > 8, "colours on the map");
    // The last runs may still be on their way to the map.
    await until("a finished cell in words", async () => {
      await map.focus();
      await page.keyboard.press("ArrowDown");
      await page.keyboard.press("ArrowUp");
      const said = await page.locator(".tab-panel [aria-live=polite].offscreen").innerText();
      return /^nucleus.*, list × none: [\d.]+ .*ms, done$/.test(said);
    });
    await page.getByLabel("Metric").selectOption("mean_triangles");
    await page.getByText("mean_triangles (triangles):").waitFor();
  });

  await step(page, "the table sorts and filters, and says what is wrong with a filter", async () => {
    await tab(page, "Table");
    await page.getByText("15 runs", { exact: true }).waitFor();
    const column = async () => (await page.locator(".rows tbody tr[data-index] td:nth-child(9)").allInnerTexts()).map((t) => Number(t.replace(/[^\d.]/g, "")));
    const sort = page.locator("thead").getByRole("button", { name: /^mean_triangles/ });
    await sort.click();
    await page.locator("th[aria-sort=ascending]").waitFor();
    await until("all rows", async () => (await column()).length === 15);
    const ascending = await column();
    check(ascending.every((x, i) => i === 0 || x >= ascending[i - 1]), "ascending", ascending);
    await sort.click();
    await page.locator("th[aria-sort=descending]").waitFor();
    await until("the largest first", async () => (await column())[0] === ascending[14]);
    const filter = page.getByRole("searchbox", { name: "Filter" });
    await filter.fill("structure = octree and culling != none");
    await filter.press("Enter");
    await page.getByText("4 runs", { exact: true }).waitFor();
    check(page.url().includes("where="), "the filter is in the address", page.url());
    page.expectComplaint(/4\d\d GET .*where=/);
    await filter.fill("structur = octree");
    await filter.press("Enter");
    await page.getByRole("alert").filter({ hasText: "structur" }).waitFor();
    check((await filter.getAttribute("aria-invalid")) === "true", "the box is marked");
    await filter.fill("");
    await filter.press("Enter");
    await page.getByText("15 runs", { exact: true }).waitFor();
    check((await page.locator(".filter-error").innerText()) === "", "the mistake is gone");
  });

  await step(page, "fronts, claims, charts, manifest and environment load", async () => {
    await tab(page, "Fronts");
    await page.locator("svg.scatter .point").first().waitFor();
    const axes = { x: await page.getByLabel("Across", { exact: true }).inputValue(), y: await page.getByLabel("Up", { exact: true }).inputValue() };
    check(axes.x === "total_cull_ms" && axes.y === "mean_triangles", "the usual axes", axes);
    const { scenes } = await ask(page, `/studies/tiny@0/front?x=${axes.x}&y=${axes.y}`);
    const points = await page.locator("svg.scatter .point").count();
    check(points === scenes[0].points.length && points >= 10, "a point a run", points, scenes[0].points.length);
    await tab(page, "Claims");
    await page.getByText("The frustum submits fewer triangles than no culling").waitFor();
    check((await page.locator(".claims .badge.reproduced").count()) > 0, "the claim is reproduced");
    await tab(page, "Charts");
    const { items } = await ask(page, "/studies/tiny@0/charts");
    await until("the first chart", () => page.locator(".paper img").first().evaluate((i) => i.complete && i.naturalWidth > 100).catch(() => false));
    check((await page.locator("figure.chart").count()) === items.length, "all charts", items.length);
    await tab(page, "Manifest");
    await page.locator(".toml").getByText("frustum_pays").first().waitFor();
    await tab(page, "Excluded & environment");
    await page.getByRole("heading", { name: "How it is measured" }).waitFor();
  });

  await step(page, "everything is reached with the keyboard alone", async () => {
    await page.goto(`${address}/studies/tiny@0`);
    await settle(page);
    await page.keyboard.press("Tab");
    check((await focused(page)).includes("Skip to the content"), "the first stop skips the header", await focused(page));
    await page.keyboard.press("Enter");
    const seen = [];
    for (let i = 0; i < 12 && !seen.some((t) => t.startsWith("tab Matrix")); i += 1) {
      await page.keyboard.press("Tab");
      seen.push(await focused(page));
    }
    check(seen.some((t) => t.startsWith("tab Matrix")), "the tabs come within twelve stops", ...seen);
    await page.keyboard.press("ArrowRight");
    check((await focused(page)).startsWith("tab Table"), "an arrow moves to the next tab", await focused(page));
    await page.getByText("15 runs", { exact: true }).waitFor();
    check(await page.evaluate(() => getComputedStyle(document.activeElement).outlineStyle !== "none"), "the focus is seen");
    // Through filter and buttons into the table, and from its first link to the run.
    for (let i = 0; i < 30 && !(await focused(page)).startsWith("link 0"); i += 1) await page.keyboard.press("Tab");
    await page.keyboard.press("Enter");
    await page.waitForURL("**/runs/0");
    await page.goBack();
    await page.keyboard.press("?");
    await page.getByRole("dialog").getByRole("heading", { name: "Keyboard" }).waitFor();
    await page.keyboard.press("Escape");
    await page.keyboard.press("g");
    await page.keyboard.press("m");
    await page.waitForURL("**/machine");
  });
}

export async function compareSteps(page, address) {
  await step(page, "measured anew as the next series, and compared with the first", async () => {
    await page.goto(`${address}/studies/tiny@0`);
    await page.locator("summary", { hasText: "More" }).click();
    await page.getByRole("button", { name: "Measure anew…" }).click();
    await page.getByRole("dialog").getByRole("button", { name: "Measure anew" }).click();
    await page.waitForURL("**/studies/tiny@1");
    await finished(page);
    await page.getByRole("link", { name: "Compare…" }).click();
    await page.getByLabel("Second", { exact: true }).selectOption("tiny@0");
    await page.getByRole("button", { name: "Exchange first and second" }).click();
    await page.locator(".rows tbody tr[data-index]").nth(14).waitFor();
    check(/first=tiny(@|%40)0&second=tiny(@|%40)1/.test(page.url()), "the address names both", page.url());
    const { pairs, counts } = await ask(page, "/compare?first=tiny@0&second=tiny@1");
    check(pairs.length === 15 && (counts.none ?? 0) === 0, "fifteen pairs", counts);
    const ratios = await page.locator(".rows tbody tr[data-index] td:nth-child(6)").allInnerTexts();
    check(ratios.length === 15 && ratios.filter((r) => /^[\d.]+\s×/.test(r)).length >= 10, "ratios", ...ratios);
    check((await page.locator("svg.forest .value").count()) >= 10, "a forest");
  });
}

/** Role and name of what has the focus, and `link 0` for a run of the table. */
const focused = (page) =>
  page.evaluate(() => {
    const n = document.activeElement;
    const role = n.getAttribute("role") || (n.matches("a[href]") ? "link" : n.tagName.toLowerCase());
    return `${role} ${(n.getAttribute("aria-label") || n.textContent || "").trim().slice(0, 40)}`;
  });

/** Runs in the page: how many colours a canvas has, as far as one looks. */
function painted(canvas) {
  const { width, height } = canvas;
  const { data } = canvas.getContext("2d").getImageData(0, 0, width, height);
  const colours = new Set();
  for (let i = 0; i < data.length; i += 4 * 7) if (data[i + 3] > 0) colours.add(`${data[i]} ${data[i + 1]} ${data[i + 2]}`);
  return colours.size;
}
