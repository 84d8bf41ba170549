// Identifies the run of an ended session again by clicking, and adds the model to the store; then the dialog
// of the list of recordings.   identify.mjs URL FOLDER PASSWORD

import { answerQuestion, clickButton, goTo, logIn, press, say, screenshot, violations, waitForText, withPage } from "./chromium.mjs";

const [url, out, password] = process.argv.slice(2);

await withPage(url, out, async (context) => {
  const { page } = context;
  await goTo(context, "calibration");
  await waitForText(context, "has ended", "#view");
  if (await page.$('button[aria-label^="Identify "]')) throw new Error("the button is shown without a log in");
  await logIn(context, "calibrate", password);
  await press(context, 'button[aria-label^="Identify "]');
  await page.waitForSelector("dialog.ask[open] #identify-backlash");
  await page.select("#identify-backlash", "none");
  await screenshot(context, "identify-options");
  const faults = await violations(context);
  await answerQuestion(context, "Identify");
  await waitForText(context, "not in the store yet", "#identification");
  await waitForText(context, "Options: backlash none; begun by calibrate", "#view");
  await screenshot(context, "identify-done");
  faults.push(...await violations(context));
  await clickButton(context, "Add to the store");
  await waitForText(context, "in the store as", "#identification");
  say("added");

  await goTo(context, "recordings");
  await waitForText(context, "in the store as", "#identification");
  await press(context, 'button[aria-label^="Identify "]');
  await page.select("#identify-method", "evemu");
  await page.waitForSelector("#identify-order");
  await answerQuestion(context, "Identify");
  await waitForText(context, "no model: ", "#identification");
  await screenshot(context, "identify-failed");
  faults.push(...await violations(context));
  return faults;
});
