// Every view in three sizes, dark and light: shown without an error, accessible by axe-core, kept as
// a screenshot; and the keyboard.   views.mjs URL FOLDER

import { goTo, say, screenshot, viewports, violations, waitForText, withPage } from "./chromium.mjs";

const [url, out] = process.argv.slice(2);
const views = ["live", "calibration", "model", "history", "recordings", "configuration"];

/** The first view: time from the request to the first positions. */
async function firstView({ page }) {
  await page.goto("about:blank");
  const begin = performance.now();
  await page.goto(url);
  await page.waitForFunction(() => document.querySelector(".axis .value span")?.innerText.match(/[0-9]/));
  return performance.now() - begin;
}

/** A line wider than the window, which would scroll the whole page. */
async function tooWide({ page }) {
  return page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
}

async function keyboard(context) {
  const { page } = context;
  await goTo(context, "live");
  await page.focus("#skip");
  const reached = [];
  for (let i = 0; i < 12; ++i) {
    reached.push(await page.evaluate(() => document.activeElement.textContent.trim().slice(0, 20)));
    await page.keyboard.press("Tab");
  }
  for (const name of ["Live", "History", "Configuration"])
    if (!reached.includes(name)) return [`the key Tab does not reach "${name}": ${reached.join(", ")}`];
  await page.focus('nav a[href="#history"]');
  await page.keyboard.press("Enter");
  await waitForText(context, "Models", "#view");
  return [];
}

/** The 3-D view turns with the arrow keys: its picture changes. */
async function turns(context) {
  const { page } = context;
  await goTo(context, "model");
  const space = await page.$(".space");
  if (space === null) return ["the view Model has no 3-D view"];
  await space.scrollIntoView();
  const before = await space.screenshot({ encoding: "base64" });
  await space.focus();
  for (let i = 0; i < 5; ++i) await page.keyboard.press("ArrowLeft");
  await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
  const after = await space.screenshot({ encoding: "base64" });
  await screenshot(context, "model-turned");
  return before === after ? ["the 3-D view does not turn with the arrow keys"] : [];
}

await withPage(url, out, async (context) => {
  const { page } = context;
  const faults = [];
  say(`first view ${(await firstView(context)).toFixed(0)} ms`);
  let checked = 0;
  for (const theme of ["dark", "light"]) {
    if (await page.evaluate((t) => document.documentElement.dataset.theme !== t, theme)) await page.click("#theme");
    for (const [size, viewport] of Object.entries(viewports)) {
      await page.setViewport(viewport);
      for (const view of views) {
        await goTo(context, view);
        for (const violation of await violations(context)) faults.push(`${view}, ${size}, ${theme}: ${violation}`);
        if (await tooWide(context) > 0) faults.push(`${view}, ${size}: wider than the window by ${await tooWide(context)} px`);
        await screenshot(context, `${view}-${size}-${theme}`);
        ++checked;
      }
    }
  }
  await page.setViewport(viewports.desk);
  say(`views checked ${checked}`);
  return [...faults, ...await keyboard(context), ...await turns(context)];
});
