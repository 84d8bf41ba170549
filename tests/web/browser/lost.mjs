// The page before the first calibration; then it loses abbed, and its server. Prints "OPEN", "ABBED LOST" and "SERVER LOST" when it shows
// each.   lost.mjs URL FOLDER

import { goTo, say, screenshot, waitForText, withPage } from "./chromium.mjs";

const [url, out] = process.argv.slice(2);

await withPage(url, out, async (context) => {
  await context.page.waitForFunction(() => document.getElementById("connection").hidden);
  for (const view of ["live", "calibration", "model", "history", "recordings", "configuration"])
    await goTo(context, view);
  await goTo(context, "model");
  await waitForText(context, "The store has no models yet", "#view");
  say("OPEN");
  await waitForText(context, "abbed does not answer", "#connection");
  await screenshot(context, "lost-abbed");
  say("ABBED LOST");
  await waitForText(context, "no connection to abbe-web", "#connection");
  await screenshot(context, "lost-server");
  say("SERVER LOST");
  return [];
}, { expectLoss: true });
