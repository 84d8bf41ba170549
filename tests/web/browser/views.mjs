// Every view with the controls of an administrator, dark on a telephone and light on a desk (in the size
// that ABBE_PAGE_SIZE names: both): shown without an error, accessible by axe-core, kept as a screenshot.
// On a desk the trends, the keyboard and what the system prefers.   views.mjs URL FOLDER PASSWORD [LONGEST_MS]
// LONGEST_MS: a first view that takes longer is a fault; without it the time is only printed.

import { clickButton, drag, goTo, logIn, middleOf, nextFrame, press, resize, say, screenshot, violations, waitForText,
  withPage } from "./chromium.mjs";

const [url, out, password, longest_ms] = process.argv.slice(2);
const kTables = 14;  // that a target at a constant offset shows
const kLooks = process.env.ABBE_PAGE_SIZE ? { [process.env.ABBE_PAGE_SIZE]: ["dark", "light"] } : { phone: ["dark"], desk: ["light"] };
const views = ["live", "curves", "calibration", "model", "history", "recordings", "configuration"];

/** The first view: time from the request to the first positions. The shortest of three: what other
 * programs take from the processor is no fault of the page. */
async function firstView({ page }) {
  const took_ms = [];
  for (let i = 0; i < 3; ++i) {
    await page.goto("about:blank");
    const begin = performance.now();
    await page.goto(url, { waitUntil: "domcontentloaded" });
    await page.waitForFunction(() => document.querySelector(".axis .value span")?.innerText.match(/[0-9]/));
    took_ms.push(Math.round(performance.now() - begin));
  }
  say(`first view ${took_ms.join(", ")} ms`);
  return Math.min(...took_ms) > Number(longest_ms ?? Infinity)
    ? [`the first view took ${took_ms.join(", ")} ms, more than ${longest_ms}`] : [];
}

/** X, Y, Z in mm; B and C, which swing by 0.1 rad, in degrees. The positions come after the page. */
async function axesFaults({ page }) {
  const shown = await page.waitForFunction(() => {
    const cards = [...document.querySelectorAll(".axis")].map((c) =>
      [c.querySelector(".name").innerText, c.querySelector(".value").innerText]);
    return cards.length > 0 && cards.every(([, value]) => /[0-9]/.test(value)) && cards;
  }, { timeout: 10000 }).then((cards) => cards.jsonValue()).catch(() => null);
  if (!shown) return [`an axis shows no position for 10 s: ${await page.$eval("#view", (view) => view.innerText)}`];
  const [names, values] = [0, 1].map((i) => shown.map((card) => card[i]));
  const right = names.join("") === "XYZBC" && values.every((v, i) =>
    i < 3 ? /^-?[0-9.]+ mm$/.test(v) : /^-?[0-9.]+ \u00b0$/.test(v) && Math.abs(parseFloat(v)) < 6);
  return right ? [] : [`the axes are shown as ${JSON.stringify(shown)}`];
}

/** A line wider than the window, which would scroll the whole page. */
async function tooWide({ page }) {
  return page.evaluate(() => document.documentElement.scrollWidth - document.documentElement.clientWidth);
}

/** What the system prefers; an empty text: no preference. It holds as long as the connection. */
async function prefer(context, { scheme = "", contrast = "", motion = "" }) {
  context.client ??= await context.page.createCDPSession();
  await context.client.send("Emulation.setEmulatedMedia", { features: [
    { name: "prefers-color-scheme", value: scheme }, { name: "prefers-contrast", value: contrast },
    { name: "prefers-reduced-motion", value: motion }] });
}

/** The theme; a change of what the system prefers reaches the page with the next frame. */
async function theme(context) {
  await nextFrame(context);
  return context.page.evaluate(() => document.documentElement.dataset.theme);
}

async function keyboard(context) {
  const { page } = context;
  await goTo(context, "live");
  await page.focus("#skip");
  const reached = [];
  for (let i = 0; i < 12; ++i) {
    reached.push(await page.evaluate(() => document.activeElement.textContent.trim().slice(0, 20)));
    await page.keyboard.press("Tab");
  }
  for (const name of ["Live", "History", "Configuration"])
    if (!reached.includes(name)) return [`the key Tab does not reach "${name}": ${reached.join(", ")}`];
  return [];
}

async function space(context) {
  await goTo(context, "model");
  const element = await context.page.waitForSelector(".space canvas").then((canvas) => canvas.$("xpath/.."));
  await middleOf(context, element, "the 3-D view");
  return element;
}

/** Whether the picture of the 3-D view changes. */
async function changes(context, element, act) {
  const before = await element.screenshot({ encoding: "base64" });
  await act();
  await nextFrame(context);
  return before !== await element.screenshot({ encoding: "base64" });
}

/** The picture of the 3-D view on grey, so that only its own colours tell two pictures apart. */
async function spacePicture(context) {
  const element = await context.page.waitForSelector(".space canvas");
  const ground = (colour) => context.page.evaluate((c) => document.body.style.setProperty("background", c, "important"), colour);
  await ground("#808080");
  await nextFrame(context);
  const picture = await element.screenshot({ encoding: "base64" });
  await ground("");
  return picture;
}

/** The 3-D view turns with the arrow keys, the mouse and a finger. */
async function turns(context, size) {
  const { page } = context;
  const faults = [];
  const element = await space(context);
  const scrolled = () => page.evaluate(() => scrollY);
  if (!await changes(context, element, () => drag(context, element, 100, 0))) faults.push(`${size}: the 3-D view does not turn under the hand`);
  await screenshot(context, `model-turned-${size}`);
  if (!context.touch) {
    await element.focus();
    const left = async () => { for (let i = 0; i < 5; ++i) await page.keyboard.press("ArrowLeft"); };
    if (!await changes(context, element, left)) faults.push("the 3-D view does not turn with the arrow keys");
    return faults;
  }
  await middleOf(context, element, "the 3-D view");
  const before = await scrolled();
  await drag(context, element, 0, -150);
  await page.waitForFunction((y) => scrollY > y + 50, { timeout: 10_000 }, before)
    .catch(() => faults.push(`${size}: a finger on the 3-D view does not scroll the page`));
  return faults;
}

/** All values and tables are shown at once; one is enlarged, and closed. */
async function trends(context) {
  const { page } = context;
  await goTo(context, "history");
  const labels = await page.$$eval(".small-chart", (all) => all.map((b) => b.getAttribute("aria-label")));
  const faults = [];
  for (const value of ["before: |V|, largest", "X: M, range of EXX", "EYX: straightness", "EC0Y"])
    if (!labels.some((label) => label.startsWith(value))) faults.push(`no trend of ${value}: ${labels.join(" | ")}`);
  if (new Set(labels).size !== labels.length) faults.push(`two trends have the same name: ${labels.join(" | ")}`);
  const tables = await page.$$eval("#trend-tables .small-chart .name", (all) => all.map((name) => name.innerText));
  if (tables.length !== kTables || !tables.includes("EXX") || !tables.includes("EZY") || !tables.every((t) => /^E[A-CX-Z][XYZ]$/.test(t)))
    faults.push(`trends of ${tables.length} tables: ${tables.join(", ")}`);
  await press(context, await page.$('#trend-tables .small-chart[aria-label^="EXX: "]'), "the trend of EXX");
  await page.waitForSelector("dialog.large .chart canvas");
  await nextFrame(context);
  faults.push(...await violations(context));
  await page.screenshot({ path: `${out}/trend-enlarged.png` });
  await clickButton(context, "Close");
  await page.waitForFunction(() => document.querySelector("dialog.large") === null);

  // A view that ends takes its dialog with it.
  await press(context, await page.$(".small-chart"), "the first trend");
  await page.waitForSelector("dialog.large[open]");
  await page.evaluate(() => { location.hash = "live"; });
  await page.waitForFunction(() => document.querySelector("dialog.large") === null);
  return faults;
}

/** The page follows the system until another theme is chosen. */
async function themes(context) {
  const { page } = context;
  const faults = [];
  await prefer(context, { scheme: "light" });
  if (await theme(context) !== "light") faults.push("the page does not follow the light theme of the system");
  await press(context, "#theme");
  await page.reload();
  if (await theme(context) !== "dark") faults.push("the chosen theme is not kept");
  await prefer(context, { scheme: "dark" });
  await press(context, "#theme");
  await press(context, "#theme");  // as the system: it follows again
  await prefer(context, { scheme: "light" });
  if (await theme(context) !== "light") faults.push("the page does not follow the system again");

  await page.evaluate(() => {
    localStorage.setItem("abbe-theme", "dark");  // an earlier page kept what was not chosen
    localStorage.setItem("abbe-theme-chosen", "blue");
  });
  await page.reload();
  if (await theme(context) !== "light") faults.push("the page takes a theme from the store that was not chosen");

  const blocked = await page.evaluateOnNewDocument(() => Object.defineProperty(globalThis, "localStorage",
    { get: () => { throw new DOMException("blocked", "SecurityError"); } }));
  await page.reload();
  await press(context, "#theme");
  if (await theme(context) !== "dark") faults.push("without a store no theme can be chosen");
  await page.removeScriptToEvaluateOnNewDocument(blocked.identifier);
  await page.reload();
  return faults;
}

/** What the browser computes from style.css: colours of the page, of a link of the navigation, and what
 * an animation and a transition become. */
async function computed({ page }) {
  return page.evaluate(() => {
    const probe = document.createElement("div");
    probe.style.transition = "opacity 5s";
    probe.style.animation = "probe 5s";
    document.body.append(probe);
    const { color, backgroundColor } = getComputedStyle(document.body);
    const { transitionDuration, animationName } = getComputedStyle(probe);
    const underlined = getComputedStyle(document.querySelector("nav a")).textDecorationLine === "underline";
    const result = { color, backgroundColor, underlined, moves: transitionDuration === "5s" || animationName === "probe" };
    probe.remove();
    return result;
  });
}

/** More contrast and less motion, if the system prefers them. */
async function preferences(context) {
  const faults = [];
  const black = "rgb(0, 0, 0)", white = "rgb(255, 255, 255)";
  for (const scheme of ["dark", "light"]) {
    await prefer(context, { scheme });
    await goTo(context, "model");
    const usual = await computed(context);
    if (usual.underlined || !usual.moves || usual.color === (scheme === "dark" ? white : black))
      faults.push(`${scheme}, without a preference: ${JSON.stringify(usual)}`);
    const picture = await spacePicture(context);
    await prefer(context, { scheme, contrast: "more", motion: "reduce" });
    await nextFrame(context);
    const now = await computed(context);
    const [text, ground] = scheme === "dark" ? [white, black] : [black, white];
    if (now.color !== text || now.backgroundColor !== ground || !now.underlined || now.moves)
      faults.push(`more contrast and less motion, ${scheme}: ${JSON.stringify(now)}`);
    if (await spacePicture(context) === picture) faults.push(`${scheme}: the 3-D view has the same colours with more contrast`);
    faults.push(...(await violations(context)).map((v) => `more contrast, ${scheme}: ${v}`));
    await screenshot(context, `model-contrast-${scheme}`);
  }
  return faults;
}

await withPage(url, out, async (context) => {
  const faults = await firstView(context);
  faults.push(...await axesFaults(context));
  await logIn(context, "administer", password);
  let checked = 0;
  for (const [size, schemes] of Object.entries(kLooks)) {
    await resize(context, size);
    await waitForText(context, "Log out", "#log-in");
    for (const scheme of schemes) {
      await prefer(context, { scheme });
      if (await theme(context) !== scheme) faults.push(`${size}: the page does not follow the ${scheme} theme of the system`);
      for (const view of views) {
        await goTo(context, view);
        for (const violation of await violations(context)) faults.push(`${view}, ${size}, ${scheme}: ${violation}`);
        if (await tooWide(context) > 0) faults.push(`${view}, ${size}: wider than the window by ${await tooWide(context)} px`);
        await screenshot(context, `${view}-${size}-${scheme}`);
        ++checked;
      }
    }
    faults.push(...await turns(context, size));
  }
  await resize(context, "desk");
  await waitForText(context, "Log out", "#log-in");
  say(`views checked ${checked}`);
  return [...faults, ...await trends(context), ...await keyboard(context), ...await themes(context),
    ...await preferences(context)];
}, { everySize: false });  // the views are shown in their sizes
