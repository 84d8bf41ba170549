// Chromium without a display, for the programs of this folder. A program prints what it does as
// lines on standard output, and ends with an error if the page does not show what it must.

import { createRequire } from "node:module";
import { readFileSync } from "node:fs";
import puppeteer from "puppeteer-core";

const axeSource = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
export const kPatience_ms = 180_000;

/** A telephone and a tablet beside the machine, which are touched, and a desk with a mouse. */
export const viewports = {
  phone: { width: 390, height: 844, isMobile: true, hasTouch: true },
  tablet: { width: 1024, height: 768, isMobile: true, hasTouch: true },
  desk: { width: 1680, height: 1050 },
};

export function say(text) {
  process.stdout.write(`${text}\n`);
}

/** Opens the page at `url`; screenshots go to `out`. Errors on the console end the program. `usualSize`:
 * the viewport, unless the environment variable ABBE_PAGE_SIZE names one. `everySize`: what is pressed
 * must be reachable in all of them. */
export async function openPage(url, out, { expectLoss = false, usualSize = "desk", everySize = true } = {}) {
  const size = process.env.ABBE_PAGE_SIZE || usualSize;
  if (!(size in viewports)) throw new Error(`ABBE_PAGE_SIZE=${size}: must be ${Object.keys(viewports).join(", ")}`);
  const browser = await puppeteer.launch({
    executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", headless: true,
    args: ["--no-sandbox", "--disable-dev-shm-usage", "--use-gl=angle", "--use-angle=swiftshader",
      "--enable-unsafe-swiftshader", "--no-first-run", "--disable-extensions"],
    defaultViewport: viewports[size],
  });
  const page = await browser.newPage();
  page.setDefaultTimeout(kPatience_ms);
  const errors = [];
  page.on("console", (line) => {
    if (line.type() === "error" && !(expectLoss && /ERR_|Failed to load/.test(line.text())))
      errors.push(line.text());
  });
  page.on("pageerror", (error) => errors.push(String(error)));
  page.on("requestfailed", (request) => {
    const why = request.failure()?.errorText ?? "";
    if (!expectLoss && why !== "net::ERR_ABORTED") errors.push(`${request.url()}: ${why}`);
  });
  page.on("request", (request) => {
    if (!request.url().startsWith(url) && !/^(data|blob):/.test(request.url()))
      errors.push(`the page asks another server: ${request.url()}`);
  });
  await page.goto(url, { waitUntil: "load" });
  return { browser, page, errors, out, everySize, touch: viewports[size].hasTouch ?? false };
}

/** Changes the size. Chromium loads the page again when touch comes or goes. */
export async function resize(context, size) {
  await context.page.setViewport(viewports[size]);
  context.touch = viewports[size].hasTouch ?? false;
  await context.page.waitForFunction(() => document.getElementById("view")?.dataset.ready);
}

/** The middle of an element, scrolled into the window. An error if something else lies above it. */
export async function middleOf({ page }, element, name) {
  await element.evaluate((e) => e.scrollIntoView({ block: "center" }));
  const { x, y } = await element.clickablePoint();
  const above = await element.evaluate((e, atX, atY) => {
    const hit = document.elementFromPoint(atX, atY);
    return hit && (e === hit || e.contains(hit)) ? null : hit?.outerHTML.slice(0, 120) ?? "nothing";
  }, x, y);
  if (above !== null) throw new Error(`${name} cannot be reached: there is ${above}`);
  return { x, y };
}

/** An error if the element cannot be reached in a window as large as one of the viewports. Touch stays:
 * Chromium loads the page again when it comes or goes. */
async function reachInEverySize(context, element, name) {
  const { page } = context;
  const own = page.viewport();
  for (const [size, { width, height }] of Object.entries(viewports)) {
    await page.setViewport({ ...own, width, height });
    await nextFrame(context);
    await middleOf(context, element, `${name} (${size})`);
  }
  await page.setViewport(own);
  await nextFrame(context);
}

/** Clicks with the mouse or taps with a finger, as the browser gets it from the system. `target`: a
 * selector or an element. */
export async function press(context, target, name = String(target)) {
  const element = typeof target === "string" ? await context.page.waitForSelector(target) : target;
  if (context.everySize) await reachInEverySize(context, element, name);
  const { x, y } = await middleOf(context, element, name);
  if (context.touch) await context.page.touchscreen.tap(x, y);
  else await context.page.mouse.click(x, y);
}

/** Drags with the mouse or a finger from the middle of an element, dx and dy in pixels. */
export async function drag(context, element, dx, dy) {
  const { page, touch } = context;
  const { x, y } = await middleOf(context, element, "what is dragged");
  if (touch) await page.touchscreen.touchStart(x, y);
  else { await page.mouse.move(x, y); await page.mouse.down(); }
  const steps = 12;
  for (let i = 1; i <= steps; ++i) {
    const to = [x + dx * i / steps, y + dy * i / steps];
    await (touch ? page.touchscreen.touchMove(...to) : page.mouse.move(...to));
    await nextFrame(context);
  }
  await (touch ? page.touchscreen.touchEnd() : page.mouse.up());
  await nextFrame(context);
}

/** Until what was changed before is drawn. */
export async function nextFrame({ page }) {
  await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
}

/** Shows a view by clicking its link. */
export async function goTo(context, name) {
  const { page } = context;
  await press(context, `nav a[href="#${name}"]`);
  await page.waitForFunction((n) => document.getElementById("view").dataset.ready === n, {}, name);
  const fault = await viewFault(context);
  if (fault) throw new Error(`the view ${name} shows a fault: ${fault}`);
}

/** The fault that a view shows instead of its content; null: none. */
export async function viewFault({ page }) {
  return page.evaluate(() => document.querySelector("#view > div > p.bad")?.innerText ?? null);
}

/** Waits until the page shows the text, in the element of `selector`. Looks at every change of the
 * page: a state such as "acquiring" lasts 2 s here, and a loaded computer may draw no frame in that time. */
export async function waitForText({ page }, text, selector = "body") {
  await page.waitForFunction(
    (s, t) => document.querySelector(s)?.innerText.includes(t), { polling: "mutation", timeout: kPatience_ms },
    selector, text)
    .catch(async (error) => {
      const shown = await page.evaluate((s) => document.querySelector(s)?.innerText ?? "(no such element)", selector);
      throw new Error(`"${text}" did not appear in ${selector}: ${error.message}\nshown:\n${shown}`);
    });
}

/** A button with this text or label that is shown. */
export async function button({ page }, text) {
  const found = await page.evaluateHandle((t) => [...document.querySelectorAll("button")]
    .find((b) => (b.innerText === t || b.getAttribute("aria-label") === t) && b.offsetParent), text);
  const element = found.asElement();
  if (!element) throw new Error(`there is no button "${text}"`);
  return element;
}

export async function clickButton(context, text) {
  await press(context, await button(context, text), `the button "${text}"`);
}

async function typeInto(context, selector, text) {
  await press(context, selector);
  await context.page.keyboard.type(text);
}

/** Answers the question of the page with the button `yes`, and a reason if it asks for one. */
export async function answerQuestion(context, yes, reason = null) {
  const { page } = context;
  await page.waitForSelector("dialog.ask[open]");
  if (reason !== null) await typeInto(context, "dialog.ask input[name=reason]", reason);
  const said = await page.$eval("dialog.ask button[value=yes]", (b) => b.innerText);
  if (said !== yes) throw new Error(`the question offers "${said}", not "${yes}"`);
  await press(context, "dialog.ask button[value=yes]");
}

export async function logIn(context, user, password) {
  await press(context, "#log-in");
  await typeInto(context, "input[name=user]", user);
  await typeInto(context, "input[name=password]", password);
  await press(context, "#log-in-form button[type=submit]");
  await waitForText(context, `Log out ${user}`, "#log-in");
  await context.page.waitForFunction(() => !document.querySelector("#log-in-dialog").open);
}

/** The dialog of the system for files is not part of the page. */
export async function chooseFile({ page }, selector, file) {
  const input = await page.waitForSelector(selector);
  await input.uploadFile(file);
}

/** Memory of the page, MB: `heap`, used by JavaScript after a collection of garbage; `resident`, the
 * largest process of Chromium that draws pages. */
export async function memory({ browser, page }) {
  const client = await page.createCDPSession();
  await client.send("HeapProfiler.collectGarbage");
  const { usedSize } = await client.send("Runtime.getHeapUsage");
  await client.detach();
  const system = await browser.target().createCDPSession();
  const { processInfo } = await system.send("SystemInfo.getProcessInfo");
  await system.detach();
  const resident_kB = processInfo.filter(({ type }) => type === "renderer").map(({ id }) =>
    Number(/VmRSS:\s*(\d+) kB/.exec(readFileSync(`/proc/${id}/status`, "utf8"))?.[1] ?? 0));
  return { heap: usedSize / 2 ** 20, resident: Math.max(...resident_kB) / 2 ** 10 };
}

/** A page must not keep what every event brings. */
export function memoryFaults(before, after) {
  const kMostGrowth = { heap: 8, resident: 100 };
  const MB = (m) => `${m.heap.toFixed(1)} MB of JavaScript, ${m.resident.toFixed(0)} MB resident`;
  say(`memory ${MB(before)}, then ${MB(after)}`);
  if (![before, after].every((m) => m.heap > 0 && m.resident > 0))
    return [`the memory is not known: ${MB(before)}, then ${MB(after)}`];
  return Object.entries(kMostGrowth).filter(([of, most]) => after[of] - before[of] > most)
    .map(([of, most]) => `the memory (${of}) grew by more than ${most} MB: ${MB(before)}, then ${MB(after)}`);
}

export async function screenshot({ page, out }, name) {
  await page.screenshot({ path: `${out}/${name}.png`, fullPage: true });
}

/** Violations of WCAG 2.2 A and AA that axe-core finds, in words. */
export async function violations({ page }) {
  await page.evaluate(axeSource);
  const found = await page.evaluate(() => axe.run(document, {
    runOnly: { type: "tag", values: ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa"] } }));
  return found.violations.flatMap((v) =>
    v.nodes.map((n) => `${v.id}: ${v.help}: ${n.target.join(" ")}: ${n.failureSummary ?? ""}`));
}

/** Ends the program: exit code 1 with `faults`. */
export async function finish({ browser, errors }, faults = []) {
  await browser.close();
  const all = [...errors.map((e) => `console: ${e}`), ...faults];
  for (const fault of all) say(`FAULT ${fault}`);
  process.exitCode = all.length > 0 ? 1 : 0;
}

/** Runs `use` with an open page; an exception leaves a screenshot "failed". */
export async function withPage(url, out, use, options) {
  const context = await openPage(url, out, options);
  try {
    await finish(context, await use(context));
  } catch (error) {
    await screenshot(context, "failed").catch(() => {});
    await finish(context, [error.stack ?? String(error)]);
  }
}
