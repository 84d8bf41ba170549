// Replays a recording by clicking.   replay.mjs URL FOLDER PASSWORD

import { goTo, logIn, press, say, screenshot, waitForText, withPage } from "./chromium.mjs";

const [url, out, password] = process.argv.slice(2);

await withPage(url, out, async (context) => {
  await logIn(context, "calibrate", password);
  await goTo(context, "recordings");
  await press(context, 'button[aria-label^="Replay "]');
  await waitForText(context, "the same model as live", "#view");
  await screenshot(context, "replay");
  say("replayed");
  return [];
});
