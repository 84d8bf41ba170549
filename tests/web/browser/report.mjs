// The report of a model as it is printed on A4: nothing is cut off, no number is broken into two lines,
// and the PDF contains every word of the page.
//   node report.mjs FILE-URL SCREENSHOTS PDF

import { execFileSync } from "node:child_process";
import { basename } from "node:path";
import { say, screenshot, withPage } from "./chromium.mjs";

const [url, out, pdf] = process.argv.slice(2);
const name = basename(pdf, ".pdf");
const pixels = (mm) => Math.round(mm / 25.4 * 96);
/** A4 without the margins of the style sheet. */
const paper = { width: pixels(210 - 2 * 10), height: pixels(297 - 2 * 12) };

/** What does not fit on the paper. */
function faultsOfTheLayout(width) {
  const faults = [];
  for (const e of document.querySelectorAll("body *")) {
    const { left, right } = e.getBoundingClientRect();
    if (right > width + 1 || left < -1)
      faults.push(`${e.tagName} is cut off: ${left.toFixed()} to ${right.toFixed()} px of ${width}: ${e.textContent.slice(0, 60)}`);
  }
  for (const cell of document.querySelectorAll("td")) {
    if (!/^[-+]?[\d.]+$/.test(cell.innerText)) continue;
    const text = document.createRange();
    text.selectNodeContents(cell);
    if (text.getClientRects().length !== 1) faults.push(`a number is broken: ${cell.innerText}`);
  }
  return faults;
}

/** The words that a reader of the page sees. */
function wordsOfThePage() {
  const texts = [...document.querySelectorAll("h1, h2, p, th, td, li, .signal span, svg text")];
  return [...new Set(texts.flatMap((e) => e.textContent.split(/\s+/)))].filter((word) => word);
}

/** Without the ligatures of the font. */
function plain(text) {
  return text.normalize("NFKC").replace(/\s+/g, "");
}

await withPage(url, out, async (context) => {
  const { page } = context;
  await page.emulateMediaType("print");
  await page.setViewport(paper);
  const faults = await page.evaluate(faultsOfTheLayout, paper.width);
  await screenshot(context, name);

  const info = execFileSync("pdfinfo", [pdf], { encoding: "utf8" });
  if (!/^Page size: .*\(A4\)$/m.test(info)) faults.push(`the pages of the PDF are not A4: ${info}`);
  // pdftotext ends each page with a form feed.
  const pages = execFileSync("pdftotext", ["-raw", pdf, "-"], { encoding: "utf8" }).split("\f").slice(0, -1);
  const headings = await page.$$eval("h2", (all) => all.map((h) => h.innerText));
  pages.forEach((text, i) => {
    const lines = text.trim().split("\n");
    if (lines[0] === "") faults.push(`page ${i + 1} of the PDF is empty`);
    if (headings.includes(lines.at(-1))) faults.push(`page ${i + 1} of the PDF ends with the heading "${lines.at(-1)}"`);
  });
  const printed = plain(pages.join(""));
  const words = await page.evaluate(wordsOfThePage);
  for (const word of words)
    if (!printed.includes(plain(word))) faults.push(`the PDF does not contain "${word}"`);
  say(`REPORT ${name}: ${words.length} words on ${pages.length} pages`);
  return faults;
});
