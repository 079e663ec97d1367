// What the tests of the page share: a server of their own, a browser, steps with names,
// and a watch over everything that the browser complains about.

import { spawn, spawnSync } from "node:child_process";
import { mkdtempSync, mkdirSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { createRequire } from "node:module";

const { chromium } = createRequire(`${process.env.PLAYWRIGHT}/`)("playwright-core");

export const TEMP = process.env.BROWSER_TEMP || mkdtempSync(join(tmpdir(), "cullmark-browser-"));
export const SHOTS = process.env.SHOTS || join(TEMP, "shots");
mkdirSync(SHOTS, { recursive: true });
const STEP_MS = 30000;

/** Fails with what was expected where; values are shown, since nobody can look afterwards. */
export function check(ok, what, ...seen) {
  if (!ok) throw new Error(`${what}${seen.length ? `; found ${seen.map((s) => JSON.stringify(s)).join(", ")}` : ""}`);
}

/** Waits until `ask` answers something true, and answers that. */
export async function until(what, ask, ms = STEP_MS) {
  const end = Date.now() + ms;
  for (let last; ; ) {
    last = await ask();
    if (last) return last;
    if (Date.now() > end) throw new Error(`waited ${ms / 1000} s for ${what}; last ${JSON.stringify(last)}`);
    await new Promise((resolve) => setTimeout(resolve, 100));
  }
}

/** A server on a database of its own; `tokens` are `{name: role}` and come back as texts. */
export async function startServer(name, { tokens = {}, more = [] } = {}) {
  const dir = join(TEMP, name);
  mkdirSync(dir, { recursive: true });
  const env = { ...process.env, CULLMARK_LANE: join(dir, "lane") };
  const db = join(dir, "cullmark.db");
  const given = {};
  for (const [id, role] of Object.entries(tokens)) {
    const made = spawnSync(process.env.CULLMARK, ["token", "add", id, "--role", role, "--db", db], { env, encoding: "utf8" });
    check(made.status === 0, `token ${id}`, made.stderr);
    given[id] = made.stdout.trim().split(/\s+/).pop();
  }
  const child = spawn(process.env.CULLMARK, ["serve", "--listen", "127.0.0.1:0", "--db", db, "--grace-s", "1", ...more], {
    env,
    cwd: dir,
  });
  let out = "";
  let log = "";
  child.stdout.on("data", (text) => (out += text));
  child.stderr.on("data", (text) => (log += text));
  const address = await until("the server's address", () => {
    check(child.exitCode === null, "the server ended", log);
    return /listening on (http:\S+)/.exec(out)?.[1];
  });
  return {
    address,
    tokens: given,
    log: () => log,
    async stop() {
      child.kill("SIGTERM");
      await until("the server's end", () => child.exitCode !== null || child.signalCode !== null, 15000);
    },
  };
}

/** Headless Chromium with WebGL in software: the same picture on every machine. */
export const startBrowser = () =>
  chromium.launch({
    executablePath: process.env.CHROMIUM,
    args: ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist", "--force-color-profile=srgb"],
    chromiumSandbox: false,
  });

/**
 * A tab that remembers complaints: errors of the console, of scripts and of the policy,
 * and requests that failed. `expect(pattern)` allows one that a test provokes.
 */
export async function newPage(browser, options = {}) {
  const context = await browser.newContext({ viewport: { width: 1360, height: 900 }, ...options });
  await context.grantPermissions(["clipboard-read", "clipboard-write"]);
  const page = await context.newPage();
  page.setDefaultTimeout(STEP_MS);
  const complaints = [];
  const expected = [];
  const complain = (text) => {
    if (!expected.some((pattern) => pattern.test(text))) complaints.push(text);
  };
  page.on("console", (m) => {
    // A refused request is told by the response as well, with more to go by.
    if (["error", "warning"].includes(m.type()) && !/Failed to load resource/.test(m.text()) && !/GPU stall/.test(m.text()))
      complain(`console ${m.type()}: ${m.text()}`);
  });
  page.on("pageerror", (e) => complain(`script: ${e.stack || e}`));
  page.on("response", (r) => r.status() >= 400 && complain(`${r.status()} ${r.request().method()} ${r.url()}`));
  page.on("requestfailed", (r) => {
    // Left pages and newer questions end the older requests.
    if (r.failure()?.errorText !== "net::ERR_ABORTED") complain(`${r.failure()?.errorText} ${r.method()} ${r.url()}`);
  });
  await page.addInitScript(() => {
    window.violations = [];
    document.addEventListener("securitypolicyviolation", (e) => {
      console.error(`policy: ${e.violatedDirective} ${e.blockedURI} ${e.sourceFile}:${e.lineNumber}`);
    });
  });
  return Object.assign(page, {
    complaints,
    expectComplaint: (pattern) => expected.push(pattern),
  });
}

/** Asks the API from inside the page, so that what the page may do is what is tested. */
export const ask = (page, path) =>
  page.evaluate(async (p) => {
    const response = await fetch(`/api/v1${p}`);
    return response.json();
  }, path);

let failures = 0;
let done = 0;
export const results = () => ({ failures, done });

/** One step: its name, its time, and on failure a picture and the reason. */
export async function step(page, name, work) {
  const start = Date.now();
  try {
    await work();
    check(page.complaints.length === 0, "the browser complained", ...page.complaints);
    console.log(`ok   ${name} (${((Date.now() - start) / 1000).toFixed(1)} s)`);
    done += 1;
    return true;
  } catch (error) {
    failures += 1;
    console.log(`FAIL ${name}\n     ${String(error.stack || error).split("\n").join("\n     ")}`);
    console.log(`     at ${page.url()}`);
    const picture = join(SHOTS, `failed-${failures}.png`);
    await page.screenshot({ path: picture }).then(() => console.log(`     picture: ${picture}`), () => {});
    page.complaints.length = 0;
    return false;
  }
}
