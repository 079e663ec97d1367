// A scene of one's own: uploaded, flown through, its path recorded and measured. The poses
// that come back must be those recorded, or axes, scale or origin are wrong on the way.

import { ask, check, step, until } from "./harness.mjs";
import { finished, submit } from "./study.mjs";

/** A hall of boxes as OBJ with y up, away from the origin, so that mixed-up axes show. */
function hall() {
  const lines = [];
  let base = 1;
  const box = (x, y, z, w, h, d) => {
    for (let i = 0; i < 8; i += 1) lines.push(`v ${x + (i & 1) * w} ${y + ((i >> 1) & 1) * h} ${z + (i >> 2) * d}`);
    for (const f of ["1 3 4 2", "5 6 8 7", "1 2 6 5", "3 7 8 4", "1 5 7 3", "2 4 8 6"])
      lines.push(`f ${f.split(" ").map((k) => Number(k) + base - 1).join(" ")}`);
    base += 8;
  };
  box(95, 0, -45, 30, 0.5, 40);
  for (let i = 0; i < 5; i += 1) for (let k = 0; k < 6; k += 1) box(98 + 5 * i, 0.5, -42 + 6 * k, 1.5, 2 + i, 2);
  return `# ${base} corners\n${lines.join("\n")}\n`;
}

export async function uploadSteps(page, address) {
  let recorded = [];
  await step(page, "an OBJ is uploaded; what is none is refused with the reason", async () => {
    await page.goto(`${address}/scenes`);
    const input = page.locator("input[type=file]");
    await input.setInputFiles({ name: "hall.obj", mimeType: "text/plain", buffer: Buffer.from(hall()) });
    await page.getByText('file = "upload:hall.obj"').waitFor();
    check(/372/.test(await page.locator("tr", { hasText: "hall.obj" }).innerText()), "31 boxes of 12 triangles", await page.locator("tr", { hasText: "hall.obj" }).innerText());
    page.expectComplaint(/4\d\d POST .*name=broken\.csv/);
    await input.setInputFiles({ name: "broken.csv", mimeType: "text/csv", buffer: Buffer.from("frame,px\n0,one\n") });
    await page.locator(".queue .alarm", { hasText: "broken.csv" }).waitFor();
  });

  await step(page, "its viewer records a flight, and key poses make a path that is uploaded", async () => {
    await page.getByRole("link", { name: "Fly and record a path" }).click();
    await until("the scene", () => page.evaluate(() => window.__viewer?.ready && window.__viewer.counts.triangles === 372));
    const pane = page.locator(".cmv-pane").first();
    await pane.focus();
    await page.keyboard.press("r");
    await page.keyboard.down("w");
    await until("some frames of a flight", () => page.evaluate(() => window.__viewer.recorder.sampler?.poses.length > 6));
    await page.keyboard.up("w");
    await page.keyboard.press("r");
    const flown = Number(/(\d+) frames/.exec(await page.locator(".cmv-section", { hasText: "Record a path" }).locator(".cmv-note").first().innerText())[1]);
    check(flown >= 5, "a flight of some frames", flown);
    // Exactly so many frames as wanted: two key poses.
    await page.getByRole("button", { name: "Clear" }).click();
    await page.getByLabel("frames to the next").fill("9");
    await page.getByLabel("frames to the next").press("Tab");
    await pane.focus();
    await page.keyboard.press("p");
    for (const key of ["w", "l"]) {
      // Pictures may be slow in coming on a busy machine: until it has moved.
      const before = await page.evaluate(() => JSON.stringify(window.__viewer.stage.fly.pose));
      await page.keyboard.down(key);
      await until("a move", async () => (await page.evaluate(() => JSON.stringify(window.__viewer.stage.fly.pose))) !== before);
      await page.waitForTimeout(200);
      await page.keyboard.up(key);
    }
    await page.keyboard.press("p");
    await page.getByText("10 frames from 2 key poses").waitFor();
    recorded = await page.evaluate(() => window.__viewer.recorder.poses.map((p) => [...p.eye, ...p.forward, ...p.up]));
    const origin = await page.evaluate(() => window.__viewer.recorder.placement.origin);
    recorded = recorded.map((p) => p.map((x, k) => (k < 3 ? x + origin[k] : x)));
    const moved = Math.hypot(...[0, 1, 2].map((k) => recorded[9][k] - recorded[0][k]));
    check(moved > 0.05, "the camera moved", moved);
    await page.getByLabel("Name", { exact: true }).fill("flight.csv");
    await page.getByRole("button", { name: "Upload", exact: true }).click();
    await page.getByText("The path is uploaded").waitFor();
    check((await page.getByLabel("Reference of the path").inputValue()) === "upload:flight.csv", "what a manifest names it by");
  });

  await step(page, "a study of both uploads finishes, and its frames are those recorded", async () => {
    await page.goto(`${address}/submit`);
    await submit(
      page,
      `[study]\nname = "hall"\n[measure]\nrepeats = 1\npasses = 1\n[accuracy]\nframes = 2\nwidth_px = 160\nheight_px = 90\n` +
        `[[scene]]\nname = "hall"\nfile = "upload:hall.obj"\n[[path]]\nname = "flight"\nfile = "upload:flight.csv"\n` +
        `[matrix]\nstructure = ["octree:depth=3"]\nculling = ["frustum"]\n`,
      [],
      "hall",
    );
    await finished(page);
    const { runs } = await ask(page, "/studies/hall@0");
    check(runs.done === 1, "the run is done", runs);
    const view = await ask(page, "/studies/hall@0/runs/0/view");
    check(view.frames === 10 && view.poses.length === 10, "ten frames", view.frames);
    let worst = 0;
    for (const [n, pose] of view.poses.entries())
      for (const [k, x] of pose.entries()) worst = Math.max(worst, Math.abs((k < 3 ? x + view.origin[k] : x) - recorded[n][k]));
    check(worst < 1e-4, "poses measured are poses recorded", worst, view.poses[0], recorded[0]);
    await page.goto(`${address}/studies/hall@0/runs/0/view?frame=9`);
    const counts = await until("the last frame", () => page.evaluate(() => window.__viewer?.ready && window.__viewer.truth && window.__viewer.counts), 60000);
    check(counts.triangles === 372 && counts.lost === 0, "the uploaded scene", counts);
  });
}
