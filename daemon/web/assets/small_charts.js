// Small charts beside each other: one curve or several with their bands of U = 2 u; a click enlarges one.

import { draw } from "./charts.js";
import { h } from "./dom.js";

const kWidth = 200, kHeight = 90, kMargin = 6;  // units of the drawing

function svg(tag, attributes, ...children) {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...children);
  return element;
}

const threeDigits = (number) => String(Number(number.toPrecision(3)));

/** Smallest and largest of x, and of y with its band. */
function rangeOf(curves) {
  const xs = curves.flatMap((c) => c.x);
  const ys = curves.flatMap((c) => c.y.flatMap((y, i) => [y - 2 * (c.u?.[i] ?? 0), y + 2 * (c.u?.[i] ?? 0)]));
  const range = (values) => {
    const low = Math.min(...values), high = Math.max(...values);
    return high > low ? { low, high } : { low: low - 1, high: high + 1 };
  };
  return { x: range(xs), y: range(ys) };
}

function picture(curves) {
  const range = rangeOf(curves);
  const place = (value, { low, high }, length) => kMargin + (length - 2 * kMargin) * (value - low) / (high - low);
  const x = (value) => place(value, range.x, kWidth).toFixed(1);
  const y = (value) => (kHeight - place(value, range.y, kHeight)).toFixed(1);
  const parts = [];
  if (range.y.low < 0 && range.y.high > 0)
    parts.push(svg("line", { class: "zero", x1: 0, x2: kWidth, y1: y(0), y2: y(0) }));
  curves.forEach((c, number) => {
    // The newest is the strongest.
    const age = number === curves.length - 1 ? "newest" : "older";
    if (c.u) {
      const edge = (side) => c.x.map((at, i) => `${x(at)},${y(c.y[i] + side * 2 * c.u[i])}`);
      parts.push(svg("polygon", { class: `band ${age}`, points: [...edge(1), ...edge(-1).reverse()].join(" ") }));
      if (c.dots) parts.push(...c.x.map((at, i) => svg("line", { class: `bar ${age}`, x1: x(at), x2: x(at),
        y1: y(c.y[i] - 2 * c.u[i]), y2: y(c.y[i] + 2 * c.u[i]) })));
    }
    parts.push(svg("polyline", { class: `curve ${age}`, points: c.x.map((at, i) => `${x(at)},${y(c.y[i])}`).join(" ") }));
    if (c.dots) parts.push(...c.x.map((at, i) => svg("circle", { class: `dot ${age}`, cx: x(at), cy: y(c.y[i]), r: 2.5 })));
  });
  return svg("svg", { viewBox: `0 0 ${kWidth} ${kHeight}`, "aria-hidden": "true" }, ...parts);
}

/** The chart in a dialog, with its axes. */
async function enlarge(chart) {
  const place = h("div");
  const dialog = h("dialog", { class: "large", "aria-label": chart.title }, place,
    h("form", { method: "dialog", class: "tools" }, h("button", {}, "Close")));
  document.body.append(dialog);
  let end = () => {};
  dialog.addEventListener("close", () => { end(); dialog.remove(); });
  dialog.showModal();
  try {
    const remove = await draw(place, chart);
    if (dialog.open) end = remove;
    else remove();
  } catch (error) {
    place.append(h("p", { class: "bad", role: "alert" }, error.message));
  }
}

/** A button with a small picture of `chart` (see draw() of charts.js), and its newest value `words`. */
export function smallChart(chart, words = "") {
  const { y } = rangeOf(chart.curves);
  const range = `${threeDigits(y.low)} to ${threeDigits(y.high)}`;
  return h("button", { type: "button", class: "small-chart", title: `${chart.title}, ${chart.y_label}`,
    "aria-label": `${chart.title}: ${words || `${range} ${chart.y_label}`}. Enlarge`, onclick: () => enlarge(chart) },
    h("span", { class: "name" }, chart.title), picture(chart.curves), h("span", { class: "weak" }, words || `${range} ${chart.unit ?? ""}`));
}
