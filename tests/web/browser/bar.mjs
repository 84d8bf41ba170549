// A calibration with a Multi-Feature Bar is begun on a telephone by tapping; the places of the bar are
// drawn, with the first one marked.   bar.mjs URL FOLDER BAR.TOML PLAN.TOML PASSWORD

import { answerQuestion, chooseFile, clickButton, goTo, logIn, screenshot, violations, waitForText, withPage } from "./chromium.mjs";

const [url, out, bar, plan, password] = process.argv.slice(2);

await withPage(url, out, async (context) => {
  const { page } = context;
  await logIn(context, "calibrate", password);
  await goTo(context, "calibration");
  await page.select("#method", "mfb");
  await chooseFile(context, "#bar-file", bar);
  await chooseFile(context, "#plan-file", plan);
  await clickButton(context, "Begin");
  await waitForText(context, "Next: hole 1", "#view");
  await page.waitForFunction(() => /hole 1$/.test(document.querySelector(".space")?.dataset.next ?? ""));
  const faults = await violations(context);
  await screenshot(context, "bar-begun");
  await clickButton(context, "Cancel the calibration");
  await answerQuestion(context, "Cancel the calibration");
  await waitForText(context, "cancelled", "#message");
  const label = () => page.$eval(".space", (s) => s.getAttribute("aria-label"));
  for (const when of ["at the end", "opened after the end"]) {
    await page.waitForFunction(() => document.querySelector(".space")?.dataset.end === "cancelled");
    const { next } = await page.$eval(".space", (s) => ({ ...s.dataset }));
    if (next !== "" || !(await label()).includes("cancelled")) faults.push(`${when}: next "${next}", "${await label()}"`);
    await goTo(context, "live");
    await goTo(context, "calibration");
  }
  if (/Done|Touched/.test(await label())) faults.push(`what was touched is not known, but claimed: ${await label()}`);
  return faults;
}, { usualSize: "phone" });
