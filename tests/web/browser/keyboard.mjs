// Log in, activate another model and roll back with the keys alone; what has the focus is always seen.
//   keyboard.mjs URL FOLDER PASSWORD

import { screenshot, waitForText, withPage } from "./chromium.mjs";

const [url, out, password] = process.argv.slice(2);
const kMostTabs = 150;

/** What has the focus: its label or text, and whether it is seen: it has an area in the window, and in its
 * middle nothing else lies above it. The body, which has the focus between the last and the first stop, counts as seen. */
async function focused({ page }) {
  return page.evaluate(() => {
    const e = document.activeElement;
    const box = e.getBoundingClientRect();  // of it, the part in the window
    const [left, right] = [Math.max(box.left, 0), Math.min(box.right, innerWidth)];
    const [top, bottom] = [Math.max(box.top, 0), Math.min(box.bottom, innerHeight)];
    const above = document.elementFromPoint((left + right) / 2, (top + bottom) / 2);
    const name = e.getAttribute("aria-label") ?? e.getAttribute("name") ?? e.innerText.trim();
    const isStop = e !== document.body;
    return { name, marked: !isStop || e.matches(":focus-visible") || getComputedStyle(e).outlineStyle === "solid",
      seen: !isStop || (right > left && bottom > top && above !== null && (e === above || e.contains(above))) };
  });
}

/** Presses Tab until something whose name begins with `name` has the focus; every stop must be seen. */
async function tabTo(context, name, faults) {
  const passed = [];
  for (let i = 0; i < kMostTabs; ++i) {
    await context.page.keyboard.press("Tab");
    const now = await focused(context);
    passed.push(now.name.slice(0, 20));
    if (!now.marked) faults.push(`"${passed.at(-1)}" has the focus, but is not marked`);
    if (!now.seen) faults.push(`"${passed.at(-1)}" has the focus, but is not seen`);
    if (now.name.startsWith(name)) return;
  }
  throw new Error(`the key Tab does not reach "${name}": ${passed.join(", ")}`);
}

await withPage(url, out, async (context) => {
  const { page } = context;
  const { keyboard } = page;
  const faults = [];
  const tabAndEnter = async (name) => {
    await tabTo(context, name, faults);
    await keyboard.press("Enter");
  };
  await waitForText(context, "Log in", "#log-in");
  await tabAndEnter("Log in");
  await page.waitForSelector("#log-in-dialog[open]");
  if ((await focused(context)).name !== "user") await tabTo(context, "user", faults);
  await keyboard.type("administer");
  await tabTo(context, "password", faults);
  await keyboard.type(password);
  await keyboard.press("Enter");
  await waitForText(context, "Log out administer", "#log-in");

  await tabAndEnter("History");
  await page.waitForFunction(() => document.getElementById("view").dataset.ready === "history");
  await tabAndEnter("Activate ");
  await page.waitForSelector("dialog.ask[open]");
  await keyboard.type("by the keys alone");  // the field for the reason has the focus
  await screenshot(context, "keyboard-activation");
  await tabAndEnter("Activate");
  await waitForText(context, "is activated", "#message");
  await waitForText(context, "by the keys alone", "#view");

  await tabAndEnter("Roll back");
  await page.waitForSelector("dialog.ask[open]");
  await keyboard.type("back by the keys");
  await keyboard.press("Enter");
  await waitForText(context, "Rolled back", "#message");
  await waitForText(context, "back by the keys", "#view");
  return faults;
});
