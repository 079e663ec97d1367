// One run: its numbers, its charts, and the frame viewer, whose counts must be those of
// the binary frames and, where a frame was judged, of the run's record.

import { ask, check, step, until } from "./harness.mjs";

/** Runs in the page: a frame of the API, counted without the viewer's own code. */
async function countFrame([path, n]) {
  const bytes = await (await fetch(`/api/v1${path}/view/frames/${n}?truth=true`)).arrayBuffer();
  const words = new Uint32Array(bytes, 0, 8);
  const states = new Uint8Array(bytes, 32, words[2]);
  const counts = [0, 0, 0, 0];
  for (const s of states) counts[s] += 1;
  const magic = String.fromCharCode(...new Uint8Array(bytes, 0, 4));
  return { magic, triangles: words[2], nodes: words[3], submitted: words[4], visible: words[5], lost: words[6], truth: words[7] & 1, counts };
}

export const viewerAt = (page, n) =>
  until(`frame ${n} in the viewer`, () => page.evaluate((f) => window.__viewer?.ready && window.__viewer.frame === f && window.__viewer.truth && window.__viewer.counts, n), 60000);

const numberOf = async (page, what) =>
  Number((await page.locator(".cmv-legend tr", { hasText: what }).first().locator(".cmv-number").first().innerText()).replace(/\D/g, ""));

export async function runSteps(page, address) {
  let run;
  await step(page, "a run that loses triangles says so, and draws its frames", async () => {
    await page.goto(`${address}/studies/tiny@0?tab=table&where=culling%20%3D%20look_at`);
    await page.locator(".rows tbody a").first().click();
    await page.getByRole("heading", { level: 1, name: /look_at/ }).waitFor();
    run = await ask(page, `/studies/tiny@0/runs/${page.url().split("/").pop()}`);
    check(run.judged_frames.some((f) => f.false_culls > 0), "look_at loses triangles", run.judged_frames);
    await page.getByText(/Visible triangles were lost in \d+ judged frames?/).waitFor();
    await page.locator(".frame-chart canvas").first().waitFor();
    check((await page.locator(".frame-chart").count()) >= 3, "charts of the frames");
    await page.locator(".lines").first().focus();
    await page.keyboard.press("ArrowRight");
    await page.getByRole("link", { name: /View frame \d+/ }).waitFor();
  });

  const path = () => `/studies/tiny@0/runs/${run.ordinal}`;
  await step(page, "the viewer's counts are the API's, frame by frame", async () => {
    await page.getByRole("link", { name: "Frame viewer" }).click();
    const first = run.judged_frames.find((f) => f.false_culls > 0).frame;
    await viewerAt(page, first);
    for (let n = first; n < first + 3; n += 1) {
      const shown = await viewerAt(page, n);
      const told = await page.evaluate(countFrame, [path(), n]);
      check(told.magic === "CMFR" && told.truth === 1, "a frame with truth", told);
      check(told.lost === told.counts[3] && told.visible === told.counts[2] + told.counts[3], "header and states agree", told);
      const same = shown.triangles === told.triangles && shown.submitted === told.counts[1] + told.counts[2] && shown.visible === told.visible && shown.lost === told.lost;
      check(same, `frame ${n}`, shown, told);
      check((await numberOf(page, "lost")) === told.lost, "the legend", await numberOf(page, "lost"), told.lost);
      const series = await ask(page, `${path()}/series?names=triangles`);
      check(series.series[0].values[n] === told.submitted, "the series of triangles", series.series[0].values[n], told.submitted);
      const judged = run.judged_frames.find((f) => f.frame === n);
      if (judged) check(judged.submitted === told.submitted, "the run's record", judged, told);
      check(shown.lost > 0, "look_at loses triangles here", shown);
      await page.locator(".cmv-pane").first().focus();
      await page.keyboard.press("ArrowRight");
    }
  });

  await step(page, "the next loss is found", async () => {
    const judged = run.judged_frames.filter((f) => f.false_culls > 0).map((f) => f.frame);
    const here = await page.evaluate(() => window.__viewer.frame);
    const next = judged.find((n) => n > here) ?? judged[0];
    await page.getByRole("button", { name: /next loss/i }).click();
    const shown = await viewerAt(page, next);
    check(shown.lost > 0, "a loss", shown);
    await until("the address of the frame", () => new URL(page.url()).searchParams.get("frame") === String(next));
  });

  await step(page, "the picture is drawn, and a conservative run loses nothing", async () => {
    check((await colours(page)) > 12, "something is drawn", await colours(page));
    const { items } = await ask(page, "/studies/tiny@0/runs?where=structure%20%3D%20octree%20and%20culling%20%3D%20frustum&columns=status");
    await page.goto(`${address}/studies/tiny@0/runs/${items[0].ordinal}/view?frame=5`);
    const shown = await viewerAt(page, 5);
    check(shown.lost === 0 && shown.visible > 0, "nothing lost", shown);
    check((await page.locator(".cmv-section", { hasText: "Nodes of the structure" }).count()) === 1, "nodes of the octree");
  });

  await step(page, "the last run has no next, and leaving the viewer ends it", async () => {
    await page.goto(`${address}/studies/tiny@0/runs/14`);
    await page.getByRole("heading", { level: 1 }).waitFor();
    check((await page.getByRole("link", { name: "The next run in the matrix" }).count()) === 0, "no way to nowhere");
    await page.getByRole("link", { name: "The run before in the matrix" }).click();
    await page.waitForURL("**/runs/13");
    check(await page.evaluate(() => window.__viewer === undefined), "the viewer is gone");
  });
}

/** Colours in a picture of the viewer, coarsely. */
export async function colours(page) {
  const picture = await page.locator(".cmv-stage").screenshot();
  return page.evaluate(async (base64) => {
    const bytes = Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
    const bitmap = await createImageBitmap(new Blob([bytes], { type: "image/png" }));
    const c = new OffscreenCanvas(bitmap.width, bitmap.height).getContext("2d");
    c.drawImage(bitmap, 0, 0);
    const { data } = c.getImageData(0, 0, bitmap.width, bitmap.height);
    const found = new Set();
    for (let i = 0; i < data.length; i += 4 * 11) found.add(`${data[i] >> 4} ${data[i + 1] >> 4} ${data[i + 2] >> 4}`);
    return found.size;
  }, picture.toString("base64"));
}
