// The views are open while drift is found: the lamp follows, and a trend that has the focus keeps it.
// Prints "GREEN" and "FOCUSED" when drift may be found.
//   drift.mjs URL FOLDER

import { goTo, say, screenshot, waitForText, withPage } from "./chromium.mjs";

const [url, out] = process.argv.slice(2);

await withPage(url, out, async (context) => {
  const { page } = context;
  await goTo(context, "model");
  await waitForText(context, "Green: the gate accepted the model. It is the active model.", "#verdict");
  say("GREEN");
  await waitForText(context, "Yellow: accepted, but the machine has changed since.", "#verdict");
  await waitForText(context, "EXX by 4 um", "#verdict");  // among the notes
  await screenshot(context, "model-drift");
  const faults = await page.$eval("#verdict", (v) => v.dataset.lamp) === "yellow" ? [] : ["the lamp is not yellow after drift"];

  await goTo(context, "history");
  await page.focus(".small-chart");
  say("FOCUSED");
  await waitForText(context, "EYY by 3 um", "#view");  // among the events
  if (!await page.evaluate(() => document.activeElement.matches(".small-chart")))
    faults.push("a trend has lost the focus when the store changed");
  return faults;
});
