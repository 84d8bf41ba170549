// The History view with 45 models, every fifth refused: trend first, 20 models a page, search and filter,
// which the address keeps; with keys alone, in every size, and with 500 models.   history.mjs URL FOLDER

import { clickButton, goTo, nextFrame, press, resize, say, screenshot, viewports, violations, waitForText, withPage } from "./chromium.mjs";

const [url, out] = process.argv.slice(2);
const hash = ({ page }) => page.evaluate(() => location.hash);
const rows = ({ page }) => page.$$eval('[aria-label="models"] tbody tr', (all) => all.map((row) => row.innerText));
const count = (context, text) => waitForText(context, text, "#model-count");

/** What the first screen has, in this order. */
async function beginning(context) {
  const { page } = context;
  const began = performance.now();
  await goTo(context, "history");
  await count(context, "Models 1 to 20 of 45, newest first");
  await page.waitForSelector(".first-chart canvas");
  say(`history after ${Math.round(performance.now() - began)} ms`);
  const faults = [];
  const chart = await page.$eval(".first-chart canvas", (c) => c.getAttribute("aria-label"));
  if (!/before: \|V\|, largest: [0-9.]+ to [0-9.]+; after: U\(V\), largest: /.test(chart)) faults.push(`the first chart shows ${chart}`);
  const chartIsFirst = await page.evaluate(() => {
    const place = document.querySelector(".first-chart").compareDocumentPosition(document.querySelector("#view table"));
    return (place & Node.DOCUMENT_POSITION_FOLLOWING) !== 0;
  });
  if (!chartIsFirst) faults.push("the trend is not above the list");
  const shown = await rows(context);
  if (shown.length !== 20 || !shown[0].includes("2024-02-15") || !shown[1].includes("active"))
    faults.push(`the first page has ${shown.length} rows: ${shown.slice(0, 2).join(" | ")}`);
  return faults;
}

/** Filter, next page and reload: the address keeps both. */
async function filters(context) {
  const { page } = context;
  const faults = [];
  await page.select("select[name=verdict]", "accepted");
  await count(context, "Models 1 to 20 of 36, of 45 in all");
  await clickButton(context, "Older models");
  await count(context, "Models 21 to 36 of 36");
  if (await hash(context) !== "#history/verdict=accepted&page=2") faults.push(`the address of the second page is ${await hash(context)}`);
  await page.reload();
  await count(context, "Models 21 to 36 of 36");
  if (!(await rows(context)).every((row) => /accepted|active/.test(row))) faults.push("the filter of the address lets others pass");
  await page.select("select[name=verdict]", "refused");
  await count(context, "Models 1 to 9 of 9, of 45 in all");
  await press(context, "input[name=search]");
  await page.keyboard.type("rms 40");
  await count(context, "Models 1 to 1 of 1, of 45 in all");
  await screenshot(context, "history-searched");
  await clickButton(context, "Show all");
  await count(context, "Models 1 to 20 of 45");
  await page.$eval("input[name=from]", (input) => { input.value = "2024-02-11"; input.dispatchEvent(new Event("change")); });
  await count(context, "Models 1 to 5 of 5, of 45 in all");
  await page.select("select[name=method]", "evemu");
  await count(context, "of 45 in all");
  if ((await rows(context)).length !== 2) faults.push(`the method does not filter: ${(await rows(context)).join(" | ")}`);
  await page.select("select[name=verdict]", "damaged");
  await count(context, "None of 45 models matches.");
  await clickButton(context, "Show all");
  if (await hash(context) !== "#history") faults.push(`"Show all" leaves ${await hash(context)}`);
  return faults;
}

/** From the field of the search to the last page without the mouse; a button that is switched off gives
 * the focus to the other one. */
async function keys(context) {
  const { page } = context;
  const { keyboard } = page;
  await page.goto("about:blank");
  await page.goto(`${url}#history/page=2`);
  await count(context, "Models 21 to 40 of 45");
  const focus = () => page.evaluate(() => document.activeElement.innerText ?? "");
  await page.focus("input[name=search]");
  for (let i = 0; i < 60 && await focus() !== "Older models"; ++i) await keyboard.press("Tab");
  await keyboard.press("Enter");
  await count(context, "Models 41 to 45 of 45");
  if (await focus() !== "Newer models") return [`on the last page "${await focus()}" has the focus`];
  await keyboard.press("Space");
  await count(context, "Models 21 to 40 of 45");
  return [];
}

async function sizes(context) {
  const faults = [];
  for (const size of Object.keys(viewports)) {
    await resize(context, size);
    await count(context, "of 45");
    await nextFrame(context);
    const over = await context.page.evaluate(() => document.documentElement.scrollWidth - document.documentElement.clientWidth);
    if (over > 0) faults.push(`${size}: wider than the window by ${over} px`);
    faults.push(...(await violations(context)).map((v) => `${size}: ${v}`));
    await screenshot(context, `history-many-${size}`);
  }
  return faults;
}

/** 500 models of another answer: a store of this size takes the test too long. */
async function fiveHundred(context) {
  const { page } = context;
  const { models: [one], events } = await page.evaluate(() => fetch("api/history").then((answer) => answer.json()));
  const many = Array.from({ length: 500 }, (_, i) => ({ ...one, id: `${one.id.slice(0, 8)}${1000 + i}`, active: false }));
  page.on("request", (request) => (request.url().endsWith("/api/history")
    ? request.respond({ contentType: "application/json", body: JSON.stringify({ models: many, events, left_out: 7 }) })
    : request.continue()));
  await page.setRequestInterception(true);
  await goTo(context, "live");
  await goTo(context, "history");
  await count(context, "Models 1 to 20 of 500, newest first. 7 older ones are not listed here");
  await press(context, "input[name=search]");
  const took = await page.evaluate(() => {
    const field = document.querySelector("input[name=search]");
    const began = performance.now();
    for (let i = 1; i <= 4; ++i) {
      field.value = "1234".slice(0, i);
      field.dispatchEvent(new Event("input"));
    }
    return performance.now() - began;
  });
  say(`four letters searched in 500 models: ${took.toFixed(1)} ms`);
  await count(context, "Models 1 to 1 of 1, of 500 in all");
  return [];
}

await withPage(url, out, async (context) =>
  [...await beginning(context), ...await filters(context), ...await keys(context), ...await sizes(context), ...await fiveHundred(context)]);
