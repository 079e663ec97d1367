// A server that asks for tokens: the dialog, what each role may do, and forgetting.

import { check, newPage, startServer, step, until } from "./harness.mjs";

export async function tokenSteps(browser) {
  const server = await startServer("tokens", { tokens: { reader: "read", boss: "admin" }, more: ["--no-workers"] });
  const page = await newPage(browser);
  page.expectComplaint(/^401 /);
  const give = async (token) => {
    const dialog = page.getByRole("dialog", { name: "Token needed" });
    await dialog.getByLabel("Token").fill(token);
    await dialog.getByRole("button", { name: "Use token" }).click();
  };
  const button = () => page.getByRole("button", { name: "Submit" });

  await step(page, "a wrong token is refused and asked for again; a reader may not submit", async () => {
    await page.goto(`${server.address}/submit`);
    await give("not-a-token");
    await page.getByRole("dialog").getByRole("alert").waitFor();
    await give(server.tokens.reader);
    await page.getByText("Token: read").waitFor();
    await until("a disabled button", async () => (await button().getAttribute("aria-disabled")) === "true");
    const reason = await button().evaluate((b) => `${b.title} ${b.getAttribute("aria-describedby") ? document.getElementById(b.getAttribute("aria-describedby"))?.textContent : ""}`);
    check(/role “submit”/.test(reason), "the reason", reason);
    await page.goto(server.address);
    await page.getByText("No studies yet").waitFor();
  });

  await step(page, "an administrator submits, and a forgotten token is asked for again", async () => {
    await page.getByRole("button", { name: "Forget token" }).click();
    await give(server.tokens.boss);
    await page.getByText("Token: admin").waitFor();
    await page.goto(`${server.address}/submit`);
    await page.locator(".verdict .badge.good").waitFor();
    await button().click();
    await page.waitForURL("**/studies/my-study@0");
    await page.getByText("0 of 4 runs done").waitFor();
    // The token stays out of what outlives the tab.
    const kept = await page.evaluate(() => JSON.stringify({ ...localStorage }) + document.cookie);
    check(!kept.includes(server.tokens.boss), "not kept beyond the tab");
  });
  await page.context().close();
  await server.stop();
}
