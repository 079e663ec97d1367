// All tests of the page, one after the other on one server: later ones look at what earlier
// ones made. Exit status 1 if any step failed.

import { newPage, results, SHOTS, startBrowser, startServer } from "./harness.mjs";
import { compareSteps, studySteps } from "./study.mjs";
import { runSteps } from "./run.mjs";
import { uploadSteps } from "./upload.mjs";
import { tokenSteps } from "./tokens.mjs";
import { looks } from "./looks.mjs";

const begun = Date.now();
const server = await startServer("main");
const browser = await startBrowser();
try {
  const page = await newPage(browser);
  await studySteps(page, server.address);
  await runSteps(page, server.address);
  await compareSteps(page, server.address);
  await uploadSteps(page, server.address);
  await tokenSteps(browser);
  const { items } = await (await fetch(`${server.address}/api/v1/uploads`)).json();
  const hall = items.find((u) => u.kind === "scene");
  const seen = await newPage(browser);
  seen.expectComplaint(/404 GET .*none@0/);
  await looks(seen, server.address, [
    ["studies", "/"],
    ["submit", "/submit?from=tiny@0"],
    ["compare", "/compare?first=tiny@0&second=tiny@1"],
    ["scenes", "/scenes"],
    ["machine", "/machine"],
    ...["matrix", "table", "fronts", "claims", "charts", "manifest", "about"].map((t) => [`study-${t}`, `/studies/tiny@0?tab=${t}`]),
    ["run", "/studies/tiny@0/runs/7"],
    ["run-lossy", "/studies/tiny@0/runs/4"],
    ["viewer-frame", "/studies/tiny@0/runs/4/view?frame=3"],
    ["viewer-nodes", "/studies/tiny@0/runs/6/view?frame=3"],
    ...(hall ? [["viewer-scene", `/scenes/${hall.id}/view`]] : []),
    ["missing", "/nowhere"],
    ["missing-study", "/studies/none@0"],
  ]);
} finally {
  await browser.close();
  await server.stop();
}
const { done, failures } = results();
console.log(`${done} of ${done + failures} steps in ${((Date.now() - begun) / 1000).toFixed(0)} s; pictures in ${SHOTS}`);
process.exit(failures ? 1 : 0);
