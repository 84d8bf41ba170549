// Elements of the page. Texts are set as text, never as markup.

import { localTimeParts } from "./local_time.js";

/** Makes an element. `attributes`: attributes, `class`, and listeners as `onclick`. */
export function h(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value === undefined || value === null || value === false) continue;
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else element.setAttribute(name, value === true ? "" : value);
  }
  element.append(...children.flat().filter((child) => child !== null && child !== undefined));
  return element;
}

/** `columns`: [{title, number}] or texts; `rows`: arrays of texts or elements. */
export function table(caption, columns, rows) {
  const column = (c) => (typeof c === "string" ? { title: c } : c);
  const head = columns.map(column);
  const cell = (value, i) =>
    value instanceof HTMLTableCellElement
      ? value
      : h("td", { class: head[i].number ? "number" : undefined }, value);
  return h("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": caption },
    h("table", {},
      h("thead", {}, h("tr", {}, head.map((c) =>
        h("th", { scope: "col", class: c.number ? "number" : undefined }, c.title)))),
      h("tbody", {}, rows.map((row) => h("tr", {}, row.map(cell))))));
}

/** Two columns: what, value. */
export function facts(caption, pairs) {
  return h("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": caption },
    h("table", {}, h("tbody", {}, pairs.filter((p) => p[1] !== undefined && p[1] !== "")
      .map(([what, value]) => h("tr", {}, h("th", { scope: "row" }, what), h("td", {}, value))))));
}

export function fixed(value, digits) {
  return typeof value === "number" && Number.isFinite(value) ? value.toFixed(digits) : "-";
}

/** "2026-11-26 18:30:05" (UTC) */
export function when(rfc3339) {
  return rfc3339 ? rfc3339.slice(0, 19).replace("T", " ") : "";
}

/** A date of the server in local time, with UTC beside it. */
export function localWhen(rfc3339) {
  const [local, utc] = localTimeParts(Date.parse(rfc3339));
  return h("time", { datetime: rfc3339 }, local, utc ? h("span", { class: "weak" }, utc) : null);
}

export function bytes(count) {
  const units = ["B", "kB", "MB", "GB", "TB"];
  let i = 0;
  for (; count >= 1000 && i < units.length - 1; ++i) count /= 1000;
  return `${count.toFixed(i === 0 ? 0 : 1)} ${units[i]}`;
}

export function list(items) {
  return h("ul", {}, items.map((item) => h("li", {}, item)));
}
