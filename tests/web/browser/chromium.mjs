// Chromium without a display, for the programs of this folder. A program prints what it does as
// lines on standard output, and ends with an error if the page does not show what it must.

import { createRequire } from "node:module";
import { readFileSync } from "node:fs";
import puppeteer from "puppeteer-core";

const axeSource = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
export const kPatience_ms = 180_000;

/** Widths and heights of a telephone, a tablet beside the machine, and a desk. */
export const viewports = {
  phone: { width: 390, height: 844 }, tablet: { width: 1024, height: 768 }, desk: { width: 1680, height: 1050 },
};

export function say(text) {
  process.stdout.write(`${text}\n`);
}

/** Opens the page at `url`; screenshots go to `out`. Errors on the console end the program. */
export async function openPage(url, out, { expectLoss = false } = {}) {
  const browser = await puppeteer.launch({
    executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", headless: true,
    args: ["--no-sandbox", "--disable-dev-shm-usage", "--use-gl=angle", "--use-angle=swiftshader",
      "--enable-unsafe-swiftshader", "--no-first-run", "--disable-extensions"],
    defaultViewport: viewports.desk,
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
  return { browser, page, errors, out };
}

/** Shows a view by clicking its link. */
export async function goTo({ page }, name) {
  await page.click(`nav a[href="#${name}"]`);
  await page.waitForFunction((n) => document.getElementById("view").dataset.ready === n, {}, name);
  const fault = await viewFault({ page });
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

export async function clickButton({ page }, text) {
  const clicked = await page.evaluate((t) => {
    const button = [...document.querySelectorAll("button")].find((b) => b.innerText === t && b.offsetParent);
    button?.click();
    return button !== undefined;
  }, text);
  if (!clicked) throw new Error(`there is no button "${text}"`);
}

/** Answers the question of the page with the button `yes`, and a reason if it asks for one. */
export async function answerQuestion({ page }, yes, reason = null) {
  await page.waitForSelector("dialog.ask[open]");
  if (reason !== null) await page.type("dialog.ask input[name=reason]", reason);
  const said = await page.$eval("dialog.ask button[value=yes]", (b) => b.innerText);
  if (said !== yes) throw new Error(`the question offers "${said}", not "${yes}"`);
  await page.click("dialog.ask button[value=yes]");
}

export async function logIn(context, user, password) {
  await context.page.click("#log-in");
  await context.page.type("input[name=user]", user);
  await context.page.type("input[name=password]", password);
  await context.page.click("#log-in-form button[type=submit]");
  await waitForText(context, `Log out ${user}`, "#log-in");
}

export async function chooseFile({ page }, selector, file) {
  const input = await page.waitForSelector(selector);
  await input.uploadFile(file);
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
