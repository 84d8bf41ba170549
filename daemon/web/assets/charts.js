// Line charts with bands of U = 2 u, drawn by Chart.js.

import { h } from "./dom.js";
import { localTime, timeTicks, zoneOf } from "./local_time.js";
import { isDark, onPalette, palette, prefersMore } from "./palette.js";

/** Loads a classic script of the server once; after a fault the next call tries again. */
const scripts = new Map();
export function script(name) {
  if (!scripts.has(name)) {
    scripts.set(name, new Promise((resolve, reject) => {
      document.head.append(h("script", { src: name, onload: resolve,
        onerror: () => {
          scripts.delete(name);
          reject(new Error(`${name} cannot be loaded`));
        } }));
    }));
  }
  return scripts.get(name);
}

const colour = (i) => palette().curves[i % palette().curves.length];

function datasets(curves) {
  return curves.flatMap((curve, i) => {
    const points = (y) => curve.x.map((x, k) => ({ x, y: y(k) }));
    const line = { label: curve.name, data: points((k) => curve.y[k]), borderColor: colour(i),
      backgroundColor: colour(i), borderWidth: 2, pointRadius: curve.dots ? 4 : 0, pointHitRadius: 6 };
    if (!curve.u) return [line];
    const edge = { borderWidth: 0, pointRadius: 0, band: true, backgroundColor: `${colour(i)}40` };
    return [line,
      { ...edge, data: points((k) => curve.y[k] + 2 * curve.u[k]), fill: "+1" },
      { ...edge, data: points((k) => curve.y[k] - 2 * curve.u[k]), fill: false }];
  });
}

/** Of a label of the time axis, px with the space beside it. */
const kTimeLabel_px = 95;

/** Smallest and largest time of the curves; a part of the time between them is left free at both ends. */
function timeRange(curves) {
  const times = curves.flatMap((c) => c.x);
  const first = Math.min(...times), last = Math.max(...times);
  const free = Math.max((last - first) * 0.03, 3600e3);
  return { min: first - free, max: last + free };
}

/** An axis of local time for times in ms since 1970. */
export function timeAxis(axis, { min, max }) {
  return { ...axis, min, max,
    title: { ...axis.title, text: [axis.title.text, `local time (UTC${zoneOf(max)})`].filter((text) => text).join(", ") },
    afterBuildTicks: (scale) => {
      scale.ticks = timeTicks(scale.min, scale.max, Math.max(2, Math.floor((scale.width || scale.maxWidth) / kTimeLabel_px)));
    },
    ticks: { ...axis.ticks, maxRotation: 0, autoSkip: false, callback: (value, i, ticks) => ticks[i].label } };
}

/** "12.346 \u00b1 0.25 um (k = 2)" */
function valueInWords(curve, i, unit) {
  const digits = (value) => Number(value.toPrecision(6));
  const U = curve.u?.[i] ? ` \u00b1 ${Number((2 * curve.u[i]).toPrecision(2))}` : "";
  return `${digits(curve.y[i])}${U} ${unit}${U ? " (k = 2)" : ""}`;
}

/** What is shown beside a point of a chart with a time axis: time, name of the point, value with unit. */
function timeTooltip(chart) {
  const curveOf = (item) => chart.curves.find((c) => c.name === item.dataset.label);
  return {
    title: (items) => (items.length ? [localTime(items[0].parsed.x), curveOf(items[0]).names?.[items[0].dataIndex] ?? ""] : ""),
    label: (item) => `${item.dataset.label}: ${valueInWords(curveOf(item), item.dataIndex, chart.y_label)}`,
  };
}

/** Makes an axis with a title in the colours of the page. */
export function axisLook() {
  const of = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const text = of("--text");
  const grid = prefersMore() ? of("--line") : isDark() ? "#2d333b" : "#d0d7de";
  return (label) => ({ type: "linear", ticks: { color: text }, grid: { color: grid },
    title: { display: true, text: label, color: text } });
}

function options(chart) {
  const axis = axisLook();
  const text = axis("").title.color;
  return {
    animation: false, maintainAspectRatio: false, parsing: false,
    plugins: {
      title: { display: true, text: chart.title, color: text },
      legend: { labels: { color: text, filter: (item, data) => !data.datasets[item.datasetIndex].band } },
      tooltip: { filter: (item) => !item.dataset.band, ...(chart.x_is_time ? { callbacks: timeTooltip(chart) } : {}) },
    },
    scales: { x: chart.x_is_time ? timeAxis(axis(chart.x_label), timeRange(chart.curves)) : axis(chart.x_label),
      y: axis(chart.y_label) },
  };
}

/** "EXX: -3.1 to 12.4": what a screen reader reads. */
function inWords(chart) {
  const range = (curve) => {
    const known = curve.y.filter((y) => typeof y === "number");
    return `${curve.name}: ${Math.min(...known).toFixed(1)} to ${Math.max(...known).toFixed(1)}`;
  };
  return `${chart.title}, ${chart.y_label} over ${chart.x_is_time ? "time" : chart.x_label}. ${chart.curves.map(range).join("; ")}`;
}

/** Draws `chart` ({title, x_label, y_label, curves: [{name, x, y, u}]}); returns what removes it. `x_is_time`:
 * x is in ms since 1970; `names` of a curve: of its points. */
export async function draw(place, chart) {
  await script("chart.min.js");
  const canvas = h("canvas", { role: "img", "aria-label": inWords(chart) });
  place.append(h("div", { class: "chart" }, canvas));
  const make = () => new Chart(canvas,
    { type: "line", data: { datasets: datasets(chart.curves) }, options: options(chart) });
  let drawn = make();
  const again = () => { drawn.destroy(); drawn = make(); };
  const end = onPalette(again);
  return () => {
    end();
    drawn.destroy();
  };
}
