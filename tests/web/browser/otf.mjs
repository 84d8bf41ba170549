// A calibration on the fly by clicking only, from the log in to the model in force; then history,
// roll-back and replay.   otf.mjs URL FOLDER PATH.CSV PASSWORD
// Prints "BEGUN" when the machine may move.

import { answerQuestion, chooseFile, clickButton, goTo, logIn, say, screenshot, waitForText, withPage } from "./chromium.mjs";

const [url, out, path, password] = process.argv.slice(2);

await withPage(url, out, async (context) => {
  const { page } = context;
  await goTo(context, "calibration");
  await waitForText(context, "log in with the role calibrate", "#view");
  await logIn(context, "administer", password);
  await goTo(context, "calibration");
  await chooseFile(context, "#path-file", path);
  await clickButton(context, "Begin");
  await waitForText(context, "warming", "#session-state");
  say("BEGUN");

  await waitForText(context, "acquiring", "#session-state");
  await page.waitForSelector(".space canvas");
  await screenshot(context, "otf-acquiring");
  await waitForText(context, "ACTIVE", "#model-state");
  await screenshot(context, "otf-done");

  await goTo(context, "model");
  await waitForText(context, "What it does not know", "#view");
  await page.waitForSelector(".chart canvas");
  await page.waitForSelector(".space canvas");
  await screenshot(context, "otf-model");
  await goTo(context, "history");
  await waitForText(context, "active", "#view");
  await screenshot(context, "otf-history");
  await clickButton(context, "Roll back");
  await waitForText(context, "Active now: ", "dialog.ask");
  await answerQuestion(context, "Roll back", "test of the page");
  // There is no earlier model: the message of abbed is shown. Chromium reports the status 409.
  await page.waitForFunction(() => document.getElementById("message").innerText !== "");
  const message = await page.$eval("#message", (m) => m.innerText);
  context.errors.splice(0, context.errors.length, ...context.errors.filter((e) => !e.includes("409")));
  return message.includes("no model was active before") ? [] : [`roll back: ${message}`];
});
