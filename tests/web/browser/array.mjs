// A calibration with a ball array by clicking only.   array.mjs URL FOLDER CALIBRATOR.TOML PASSWORD
// Prints "BEGUN" when the machine may touch.

import { chooseFile, clickButton, goTo, logIn, say, screenshot, waitForText, withPage } from "./chromium.mjs";

const [url, out, calibrator, password] = process.argv.slice(2);

await withPage(url, out, async (context) => {
  const { page } = context;
  await logIn(context, "calibrate", password);
  await goTo(context, "calibration");
  await page.select("#method", "evemu");
  await clickButton(context, "Begin");
  await waitForText(context, "choose a file", "#message");  // none was chosen
  await chooseFile(context, "#calibrator-file", calibrator);
  await clickButton(context, "Begin");
  await waitForText(context, "warming", "#session-state");
  say("BEGUN");

  await waitForText(context, "Next: ball", "#view");
  await page.waitForSelector(".space canvas");
  await screenshot(context, "array-acquiring");
  await waitForText(context, "ACTIVE", "#model-state");
  await screenshot(context, "array-done");
  await goTo(context, "model");
  await waitForText(context, "What it does not know", "#view");
  await screenshot(context, "array-model");
  await goTo(context, "history");
  await waitForText(context, "To activate a model or roll back, log in with the role administer", "#view");
  return [];
});
