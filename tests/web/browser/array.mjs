// A calibration with a ball array on a tablet, by tapping only; the drawing shows what the guide asks
// for.   array.mjs URL FOLDER CALIBRATOR.TOML PASSWORD
// Prints "BEGUN" when the machine may touch.

import { chooseFile, clickButton, goTo, logIn, memory, memoryFaults, say, screenshot, violations,
  waitForText, withPage } from "./chromium.mjs";

const [url, out, calibrator, password] = process.argv.slice(2);

/** What the drawing marks as next, touched, and where it stands. */
const drawing = ({ page }) => page.$eval(".space", (s) => ({ ...s.dataset }));

/** Keeps every mark of the drawing, and what the text beside it asks for at the same time. */
async function watchMarks({ page }) {
  await page.evaluate(() => {
    globalThis.marks = [];
    const look = () => requestAnimationFrame(() => {
      const space = document.querySelector(".space");
      const [, text, , position] = /Next: ((ball|block) \d+) of position (\d+)/.exec(document.getElementById("view").innerText) ?? [];
      if (!space || !text) return;
      const now = { ...space.dataset, text, position };
      const last = globalThis.marks.at(-1);
      if (JSON.stringify(now) !== JSON.stringify(last)) globalThis.marks.push(now);
    });
    new MutationObserver(look).observe(document.getElementById("view"),
      { subtree: true, childList: true, characterData: true, attributes: true });
  });
}

/** The drawing follows the text within one change of the page, and every feature is marked once. */
function lagging(marks) {
  const faults = [];
  const changes = 1 + marks.filter((m, i) => i > 0 && m.text !== marks[i - 1].text).length;
  const late = marks.filter((m) => m.text !== m.next);
  if (late.length > changes)
    faults.push(`${late.length} of ${marks.length} marks differ from the text, which has changed ${changes} times: ${JSON.stringify(late)}`);
  for (const on of new Set(marks.map((m) => m.text)))
    if (!marks.some((m) => m.text === on && m.next === on)) faults.push(`the drawing has never marked ${on} when the text asked for it`);
  return faults;
}

function faultsOf(marks) {
  const faults = lagging(marks);
  const beforeBall4 = ["ball 1", "block 1", "block 2", "ball 2", "ball 3"];
  // The balls are asked for at every position. A block is asked for briefly and only at some: a busy
  // computer may show the page nothing of one of them, so that what the text asked for is compared (lagging).
  for (const on of ["ball 1", "ball 2", "ball 3", "ball 4"])
    if (!marks.some((m) => m.next === on)) faults.push(`the drawing has never marked ${on}`);
  for (const m of marks) {
    const [touched, begun] = [m.touched, m.begun].map((list) => list.split(",").filter((on) => on !== ""));
    if (touched.includes(m.next)) faults.push(`${m.next} is next, but drawn as touched: ${JSON.stringify(m)}`);
    if (begun.some((on) => touched.includes(on))) faults.push(`begun and touched: ${JSON.stringify(m)}`);
    // Before ball 4 is asked for, balls 1 to 3 and the blocks are touched.
    if (m.next === "ball 4" && !beforeBall4.every((on) => touched.includes(on)))
      faults.push(`ball 4 is next, but only ${m.touched} are drawn as touched`);
    // The sides of the blocks are known from the first position on, so that three balls show where it stands.
    if (m.next === "ball 4" && m.text === m.next && m.position !== marks[0].position && m.frame !== `position ${m.position}`)
      faults.push(`ball 4 of position ${m.position} is next, but the array is drawn in the frame "${m.frame}"`);
  }
  if (marks.every((m) => m.begun === "")) faults.push("nothing was drawn as begun");
  if (!marks.some((m) => m.frame === "array")) faults.push("the array was never drawn in its own frame");
  return faults;
}

/** The drawing of a calibration whose touches are complete. */
async function completeFaults(context, when) {
  const shown = await drawing(context);
  const label = await context.page.$eval(".space", (s) => s.getAttribute("aria-label"));
  const text = await context.page.$eval("#view", (v) => v.innerText);
  const good = shown.end === "complete" && shown.next === "" && shown.begun === "" &&
    shown.touched.split(",").length === 11 && label.includes("Complete: all touches were made.") &&
    !label.includes("Next") && !text.includes("touched next") && !text.includes("where it stands is known once");
  return good ? [] : [`${when}: ${JSON.stringify(shown)}, "${label}"`];
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
  await waitForText(context, "Calibration: before the start", "#session-state");
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
  const before = await memory(context);
  await page.waitForFunction(() => globalThis.marks.some((m) => /^position/.test(m.frame) && m.touched.includes("ball 3")));
  await screenshot(context, "array-posed");
  await waitForText(context, "ACTIVE", "#model-state");
  await page.waitForFunction(() => document.querySelector(".space")?.dataset.end === "complete");
  faults.push(...memoryFaults(before, await memory(context)));
  await screenshot(context, "array-done");
  const said = await page.$eval("#message", (m) => m.innerText);
  if (said !== "") faults.push(`after the last touch the page still says "${said}"`);
  faults.push(...faultsOf(await page.evaluate(() => globalThis.marks)), ...await completeFaults(context, "at the end"));
  await goTo(context, "live");
  await goTo(context, "calibration");
  await page.waitForFunction(() => document.querySelector(".space")?.dataset.end === "complete");
  faults.push(...await completeFaults(context, "opened after the end"));
  await goTo(context, "model");
  await waitForText(context, "What it does not know", "#view");
  await screenshot(context, "array-model");
  await goTo(context, "history");
  await waitForText(context, "To activate a model or roll back, log in with the role administer", "#view");
  return faults;
}, { usualSize: "tablet" });
