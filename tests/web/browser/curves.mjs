// Curves: the values since abbe-web was started, also those of the time before the view was opened; windows,
// pause, hover, and a gap while abbed does not answer. Prints "SHOWN" when abbed may end, and "GAP" when it
// may start again.   curves.mjs URL FOLDER

import { clickButton, goTo, nextFrame, press, resize, say, screenshot, viewports, violations, waitForText, withPage } from "./chromium.mjs";

const [url, out] = process.argv.slice(2);

/** Means of a curve as drawn, null where there is none. */
const drawn = ({ page }, group, name) => page.evaluate((g, n) => {
  const canvas = document.querySelector(`section[aria-label="${g}"] canvas`);
  const set = Chart.getChart(canvas).data.datasets.find(({ label }) => label === n);
  return set?.data.map(({ y }) => (Number.isNaN(y) ? null : y)) ?? [];
}, group, name);
const rangeOf = ({ page }) => page.evaluate(() => {
  const { min, max } = Chart.getChart(document.querySelector("section canvas")).scales.x;
  return { min, max };
});
const cell = ({ page }, group, name) => page.evaluate((g, n) => [...document.querySelectorAll(`section[aria-label="${g}"] tbody tr`)]
  .find((row) => row.querySelector("th").innerText.trim() === n)?.children[1].innerText, group, name);

async function untilDrawn(context, group, name, wanted, what) {
  for (let i = 0; i < 600; ++i) {
    const means = await drawn(context, group, name).catch(() => []);
    if (wanted(means)) return;
    await new Promise((done) => setTimeout(done, 200));
  }
  throw new Error(`${what}: ${group} ${name} shows ${JSON.stringify(await drawn(context, group, name))}`);
}
const known = (means) => means.filter((mean) => mean !== null).length;

/** The curve is there at once: abbe-web kept it while another view was open. */
async function sinceTheStart(context) {
  const faults = [];
  await waitForText(context, "X", ".axis");
  await new Promise((done) => setTimeout(done, 6000));
  await goTo(context, "curves");
  await context.page.waitForSelector('section[aria-label="Linear axes"] canvas');
  const first = known(await drawn(context, "Linear axes", "X"));
  if (first < 4) faults.push(`when the view is opened, X has ${first} values`);
  await untilDrawn(context, "Linear axes", "X", (means) => known(means) > first, "the curve moves on");
  for (const name of ["B", "C"]) if (known(await drawn(context, "Rotary axes", name)) === 0) faults.push(`no curve of ${name}`);
  if (!/^-?[0-9.]+$/.test(await cell(context, "Linear axes", "Y"))) faults.push(`the table shows Y as ${await cell(context, "Linear axes", "Y")}`);
  return faults;
}

/** The mouse above the newest value shows values with their unit. */
async function hover(context) {
  const { page } = context;
  const canvas = await page.waitForSelector('section[aria-label="Linear axes"] canvas');
  await canvas.evaluate((c) => c.scrollIntoView({ block: "center" }));
  const where = () => canvas.evaluate((c) => {
    const chart = Chart.getChart(c);
    const { x } = chart.getDatasetMeta(0).data.findLast((point) => !point.skip);
    const box = c.getBoundingClientRect();
    // The newest value is at the edge of the area, or beyond it until the axis follows.
    return { x: box.x + Math.min(x, chart.chartArea.right - 4), y: box.y + box.height / 2 };
  });
  const shown = () => canvas.evaluate((c) => { const { title, body } = Chart.getChart(c).tooltip; return [...title ?? [], ...(body ?? []).flatMap((b) => b.lines)]; });
  let lines = [];
  // The newest value moves on with time, and a busy computer draws few pictures in a second.
  for (let i = 0; i < 20 && lines.length === 0; ++i) {
    const at = await where();
    await page.mouse.move(at.x, at.y - i);
    await nextFrame(context);
    lines = await shown();
  }
  await screenshot(context, "curves-hover");
  return /[0-9]Z/.test(lines[0]) && lines.some((line) => /^X: -?[0-9.]+ mm/.test(line)) ? [] : [`hovering shows ${JSON.stringify(lines)}`];
}

/** Pause holds the axis; going on shows what came meanwhile. */
async function pause(context) {
  const faults = [];
  await clickButton(context, "Pause");
  await waitForText(context, "Paused at ", "#view");
  const before = { range: await rangeOf(context), count: known(await drawn(context, "Linear axes", "X")) };
  await new Promise((done) => setTimeout(done, 3000));
  if ((await rangeOf(context)).max !== before.range.max) faults.push("the axis moves on during the pause");
  await clickButton(context, "Go on");
  await untilDrawn(context, "Linear axes", "X", (means) => known(means) >= before.count + 3, "after the pause");
  return faults;
}

async function windows(context) {
  const faults = [];
  for (const [name, title, length_s] of [["8h", "8 h", 28800], ["1h", "1 h", 3600]]) {
    await clickButton(context, title);
    await context.page.waitForFunction((s) => {
      const x = Chart.getChart(document.querySelector("section canvas"))?.scales.x;
      return x && Math.abs(x.max - x.min - 1000 * s) < 1;
    }, {}, length_s);
    if (await context.page.evaluate(() => location.hash) !== `#curves/${name}`) faults.push(`the address does not name ${title}`);
  }
  await context.page.reload();
  await context.page.waitForSelector('button[aria-pressed=true]');
  await context.page.waitForSelector('section[aria-label="Linear axes"] canvas');
  if (await context.page.$eval("button[aria-pressed=true]", (b) => b.innerText) !== "1 h") faults.push("the address does not keep the window");
  await clickButton(context, "5 min");
  await untilDrawn(context, "Linear axes", "X", (means) => known(means) > 5, "5 min");
  await press(context, 'section[aria-label="Linear axes"] tbody input');
  await context.page.waitForFunction(() => !Chart.getChart(document.querySelector('section[aria-label="Linear axes"] canvas'))
    .data.datasets.some(({ label }) => label === "X"));
  await press(context, 'section[aria-label="Linear axes"] tbody input');
  await untilDrawn(context, "Linear axes", "X", (means) => known(means) > 5, "X is switched on again");
  return faults;
}

/** While abbed does not answer no value is added, and no line joins what was before and after. */
async function gap(context) {
  const { page } = context;
  say("SHOWN");
  await waitForText(context, "abbed does not answer", "#connection");
  await untilDrawn(context, "Linear axes", "X", (means) => means.slice(-4).every((mean) => mean === null), "abbed does not answer");
  const shown = await cell(context, "Linear axes", "X");
  say("GAP");
  await untilDrawn(context, "Linear axes", "X", (means) => means.slice(-3).some((mean) => mean !== null), "abbed answers again");
  const lines = await page.evaluate(() => {
    const chart = Chart.getChart(document.querySelector('section[aria-label="Linear axes"] canvas'));
    const index = chart.data.datasets.findIndex(({ label }) => label === "X");
    const { curve } = chart.data.datasets[index];
    const drawn = chart.getDatasetMeta(index).dataset.segments.filter(({ style }) => style?.borderColor !== "transparent");
    return { gaps: curve.gap.filter((g) => g).length,
      crossed: drawn.filter(({ start, end }) => curve.gap.slice(start + 1, end + 1).includes(true)).length };
  });
  await screenshot(context, "curves-gap");
  return [...(shown === "-" ? [] : [`without abbed X is shown as ${shown}`]),
    ...(lines.gaps >= 1 && lines.crossed === 0 ? [] : [`${lines.gaps} gaps, and ${lines.crossed} parts of the line cross one`])];
}

async function sizes(context) {
  const faults = [];
  for (const size of Object.keys(viewports)) {
    await resize(context, size);
    await context.page.waitForSelector('section[aria-label="Linear axes"] canvas');
    await nextFrame(context);
    const over = await context.page.evaluate(() => document.documentElement.scrollWidth - document.documentElement.clientWidth);
    if (over > 0) faults.push(`${size}: wider than the window by ${over} px`);
    faults.push(...(await violations(context)).map((v) => `${size}: ${v}`));
    await screenshot(context, `curves-${size}`);
  }
  return faults;
}

await withPage(url, out, async (context) => [...await sinceTheStart(context), ...await hover(context), ...await pause(context),
  ...await windows(context), ...await sizes(context), ...await gap(context)], { expectLoss: true, everySize: false });  // the view is shown in its sizes
