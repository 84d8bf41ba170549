// A chart of curves that move on: means as lines, from smallest to largest value as a band, gaps left open.

import { axisLook, script, timeAxis } from "./charts.js";
import { isolated, valueText } from "./curve_data.js";
import { h } from "./dom.js";
import { localTime } from "./local_time.js";
import { onPalette, palette } from "./palette.js";

/** The colour of the curve number `i` of a chart. */
export const colourOf = (i) => palette().curves[i % palette().curves.length];

/** Draws what lies between smallest and largest value of each bucket, behind the lines. */
const bands = {
  id: "bands",
  beforeDatasetsDraw: ({ ctx, chartArea, scales, data }) => {
    ctx.save();
    ctx.beginPath();
    ctx.rect(chartArea.left, chartArea.top, chartArea.width, chartArea.height);
    ctx.clip();
    for (const { curve, data: points, borderColor, width_ms } of data.datasets) {
      ctx.fillStyle = `${borderColor}50`;
      const edge = (time_ms) => Math.round(scales.x.getPixelForValue(time_ms));  // neighbours touch, and do not overlap
      points.forEach(({ x }, i) => {
        if (curve.min[i] === null) return;
        const top = scales.y.getPixelForValue(curve.max[i]), bottom = scales.y.getPixelForValue(curve.min[i]);
        const left = edge(x - width_ms / 2);
        ctx.fillRect(left, top, Math.max(1, edge(x + width_ms / 2) - left), bottom - top);
      });
    }
    ctx.restore();
  },
};

function dataset(curve, colour, times, width_ms) {
  const alone = isolated(curve);
  return { label: curve.name, curve, width_ms, data: times.map((x, i) => ({ x, y: curve.mean[i] ?? NaN })),
    borderColor: colour, backgroundColor: colour, borderWidth: 1.5, spanGaps: true, pointHitRadius: 0,
    pointRadius: alone.map((a) => (a ? 1.5 : 0)), pointHoverRadius: 3,
    // A bucket may have no value because values come more slowly; where there is a gap there is no line.
    segment: { borderColor: ({ p0DataIndex, p1DataIndex }) =>
      (curve.gap.slice(p0DataIndex + 1, p1DataIndex + 1).includes(true) ? "transparent" : undefined) } };
}

function tooltip({ dataset: { curve }, dataIndex: i }, unit) {
  const text = (value) => valueText(value, unit);
  const spread = text(curve.min[i]) === text(curve.max[i]) ? "" : ` (${text(curve.min[i])} to ${text(curve.max[i])})`;
  return `${curve.name}: ${text(curve.mean[i])} ${unit}${spread}`;
}

/** A chart in `place`. Returns {show(curves, colours, times, width_ms, range), end()}: `colours` of the curves,
 * `times` of their buckets and `range` {min, max} of the axis in ms since 1970. */
export async function curveChart(place, title, unit) {
  await script("chart.min.js");
  const canvas = h("canvas", { role: "img", "aria-label": `${title}, ${unit} over time; the values are in the table below` });
  place.append(h("div", { class: "chart curves" }, canvas));
  let drawn = null;
  const options = (range, limits) => {
    const look = axisLook();
    return { animation: false, maintainAspectRatio: false, parsing: false, normalized: true,
      interaction: { mode: "index", intersect: false },
      plugins: { legend: { display: false }, title: { display: false },
        tooltip: { filter: ({ parsed }) => Number.isFinite(parsed.y),
          callbacks: { title: (items) => (items.length ? localTime(items[0].parsed.x) : ""), label: (item) => tooltip(item, unit) } } },
      scales: { x: timeAxis(look(""), range), y: { ...look(unit), suggestedMin: limits.min, suggestedMax: limits.max } } };
  };
  const show = (curves, colours, times, width_ms, range) => {
    const known = (name) => curves.flatMap((c) => c[name]).filter((value) => value !== null);
    const reduce = (values, take) => values.reduce((a, b) => take(a, b), values[0]);
    const limits = { min: reduce(known("min"), Math.min), max: reduce(known("max"), Math.max) };
    const data = { datasets: curves.map((c, i) => dataset(c, colours[i], times, width_ms)) };
    if (drawn === null) drawn = new Chart(canvas, { type: "line", data, options: options(range, limits), plugins: [bands] });
    else {
      drawn.data = data;
      drawn.options = options(range, limits);
      drawn.update("none");
    }
  };
  return { show, width: () => canvas.clientWidth, end: () => drawn?.destroy() };
}

export { onPalette };
