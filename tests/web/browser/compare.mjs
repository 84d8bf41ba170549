// Two models beside each other, and the questions before a change: by keyboard and screen reader, too.
//   compare.mjs URL FOLDER PASSWORD

import { answerQuestion, clickButton, goTo, logIn, press, screenshot, violations, waitForText, withPage } from "./chromium.mjs";

const [url, out, password] = process.argv.slice(2);

/** The question before an activation; Escape changes nothing. */
async function question(context) {
  const { page } = context;
  await goTo(context, "history");
  await press(context, 'button[aria-label^="Activate "]');
  await waitForText(context, "Then: ", "dialog.ask");
  const faults = await violations(context);
  await screenshot(context, "activation-question");
  await page.keyboard.press("Escape");
  await page.waitForFunction(() => document.querySelector("dialog.ask") === null);
  if (await page.$eval("#message", (m) => m.innerText) !== "") faults.push("Escape has changed something");

  await press(context, 'button[aria-label^="Activate "]');
  await answerQuestion(context, "Activate", "test of the page");
  await waitForText(context, "is activated", "#message");
  await waitForText(context, "test of the page", "#view");  // in the events
  await clickButton(context, "Roll back");
  await waitForText(context, "Active now: ", "dialog.ask");
  await answerQuestion(context, "Roll back", "back again");
  await waitForText(context, "Rolled back", "#message");
  await waitForText(context, "back again", "#view");
  return faults;
}

async function comparison(context) {
  const { page } = context;
  await goTo(context, "model");
  const other = await page.$eval("#compare-choice option:nth-child(2)", (o) => o.value);
  await page.select("#compare-choice", other);
  await waitForText(context, `minus V of ${other}`, "#view");
  await page.waitForSelector(".chart canvas");
  const shown = await page.$eval("#model-choice", (s) => s.value);
  const faults = [];
  if (await page.evaluate(() => location.hash) !== `#model/${shown}/${other}`)
    faults.push(`the address does not name both models: ${await page.evaluate(() => location.hash)}`);
  const labels = () => page.$$eval(".chart canvas", (all) => all.map((c) => c.getAttribute("aria-label")));
  // The charts are drawn one after the other.
  await page.waitForFunction(() => document.querySelectorAll(".chart canvas").length >= 14);
  const both = await labels();
  if (!both.every((label) => label.includes(`of ${shown}`) && label.includes(`of ${other}`)))
    faults.push(`a chart does not show both models: ${both.join(" | ")}`);
  await screenshot(context, "comparison");
  faults.push(...await violations(context));

  await page.select("#motion-choice", "difference");
  await page.waitForFunction(() =>
    document.querySelector(".chart canvas")?.getAttribute("aria-label").includes("difference"));
  const tables = await page.$$eval("#view table", (all) => all.map((t) => t.innerHTML));
  if (!tables.some((t) => t.includes(shown) && t.includes(other)))
    faults.push("no table of values has both models");
  await screenshot(context, "difference");
  await page.select("#compare-choice", "");
  await page.waitForFunction((id) => location.hash === `#model/${id}`, {}, shown);
  return faults;
}

await withPage(url, out, async (context) => {
  await logIn(context, "administer", password);
  return [...await question(context), ...await comparison(context)];
});
