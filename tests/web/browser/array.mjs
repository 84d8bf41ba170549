// A calibration with a ball array on a tablet, by tapping only; the drawing shows what the guide asks
// for.   array.mjs URL FOLDER CALIBRATOR.TOML PASSWORD
// Prints "BEGUN" when the machine may touch.

import { chooseFile, clickButton, goTo, logIn, say, screenshot, violations, waitForText, withPage } from "./chromium.mjs";

const [url, out, calibrator, password] = process.argv.slice(2);

/** What the drawing marks as next, touched, and where it stands. */
const drawing = ({ page }) => page.$eval(".space", (s) => ({ ...s.dataset }));

/** Keeps every mark of the drawing, and what the text beside it asks for at the same time. */
async function watchMarks({ page }) {
  await page.evaluate(() => {
    globalThis.marks = [];
    const look = () => requestAnimationFrame(() => {
      const space = document.querySelector(".space");
      const text = /Next: ((ball|block) \d+)/.exec(document.getElementById("view").innerText)?.[1];
      if (!space || !text) return;
      const now = { ...space.dataset, text };
      const last = globalThis.marks.at(-1);
      if (JSON.stringify(now) !== JSON.stringify(last)) globalThis.marks.push(now);
    });
    new MutationObserver(look).observe(document.getElementById("view"),
      { subtree: true, childList: true, characterData: true, attributes: true });
  });
}

function faultsOf(marks) {
  const faults = [];
  const order = ["ball 1", "block 1", "block 2", "ball 2", "ball 3"];
  const marked = new Set(marks.map((m) => m.next));
  if (marked.size < order.length) faults.push(`the drawing has marked only ${[...marked].join(", ")}`);
  if (![...marked].some((on) => on.startsWith("block"))) faults.push("the drawing has never marked a block");
  if (!marks.some((m) => m.touched.includes("block 2"))) faults.push("no block was drawn as touched");
  // The drawing follows the text at the next event of the status, when the place of the array is new.
  const agreeing = marks.filter((m) => m.text === m.next).length;
  if (agreeing < 0.5 * marks.length) faults.push(`the drawing marks something else than the text: ${JSON.stringify(marks)}`);
  for (const m of marks) {
    const touched = m.touched.split(",").filter((on) => on !== "");
    // Before ball 4 is asked for, balls 1 to 3 and the blocks are touched.
    if (m.next === "ball 4" && !["ball 1", "block 1", "block 2", "ball 2", "ball 3"].every((on) => touched.includes(on)))
      faults.push(`ball 4 is next, but only ${m.touched} are drawn as touched`);
    if (m.next === "ball 4" && !/^position \d/.test(m.frame)) faults.push(`ball 4 is next, but the array is drawn in the frame "${m.frame}"`);
  }
  if (!marks.some((m) => m.frame === "array")) faults.push("the array was never drawn in its own frame");
  return faults;
}

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
  await waitForText(context, "Next: ball 1", "#view");
  await page.waitForFunction(() => document.querySelector(".space")?.dataset.next === "ball 1");
  const faults = await violations(context);
  const first = await drawing(context);
  if (first.touched !== "" || first.frame !== "array") faults.push(`before the first touch: ${JSON.stringify(first)}`);
  await screenshot(context, "array-begun");
  await watchMarks(context);
  say("BEGUN");

  await page.waitForFunction(() => globalThis.marks.some((m) => /^block/.test(m.next)));
  await screenshot(context, "array-block");
  await page.waitForFunction(() => globalThis.marks.some((m) => /^position/.test(m.frame) && m.touched.includes("ball 3")));
  await screenshot(context, "array-posed");
  await waitForText(context, "ACTIVE", "#model-state");
  await screenshot(context, "array-done");
  faults.push(...faultsOf(await page.evaluate(() => globalThis.marks)));
  await goTo(context, "model");
  await waitForText(context, "What it does not know", "#view");
  await screenshot(context, "array-model");
  await goTo(context, "history");
  await waitForText(context, "To activate a model or roll back, log in with the role administer", "#view");
  return faults;
}, { size: "tablet" });
