// Trends over the accepted models: the volumetric error, each value, and the tables of the newest ones.

import { draw } from "./charts.js";
import { h, when } from "./dom.js";
import { smallChart } from "./small_charts.js";

/** The volumetric error before compensation, with its band, and what is left after it. */
export function volumeChart({ models, values }) {
  const times = models.map((m) => Date.parse(m.measured));
  const curves = ["V.max", "U.max"].map((key) => values.find((v) => v.key === key)).filter((v) => v).map((v) => {
    const known = v.value.map((_, i) => i).filter((i) => v.value[i] !== null);
    const withU = known.every((i) => v.u[i] !== null);
    return { name: v.name, dots: true, x: known.map((i) => times[i]), y: known.map((i) => v.value[i]),
      u: withU ? known.map((i) => v.u[i]) : undefined, names: known.map((i) => `model ${models[i].id}`) };
  }).filter((curve) => curve.x.length > 0);
  return curves.length === 0 ? null
    : { title: "Volumetric error |V| of the accepted models", x_is_time: true, x_label: "measured", y_label: "um", curves };
}

/** Draws the volumetric error into `place`; returns what removes it. */
export async function volumeTrend(place, trend) {
  const chart = volumeChart(trend);
  if (chart === null) {
    place.append(h("p", {}, "No model was accepted yet: the trend begins with the first one."));
    return () => {};
  }
  return draw(place, chart);
}

function valueChart(v, days) {
  const known = v.value.map((value, i) => ({ x: days[i], y: value, u: v.u[i] })).filter(({ y }) => y !== null);
  const withU = known.every(({ u }) => u !== null);
  const newest = known.at(-1);
  const words = `${newest.y.toFixed(2)}${withU ? ` \u00b1 ${(2 * newest.u).toFixed(2)}` : ""} ${v.unit}`;
  return smallChart({ title: v.name, x_label: "days since the first measurement", y_label: v.unit,
    curves: [{ name: v.name, dots: true, x: known.map((k) => k.x), y: known.map((k) => k.y),
      u: withU ? known.map((k) => k.u) : undefined }] }, words);
}

function tableChart(table, models) {
  return smallChart({ title: table.name, x_label: table.x_label, y_label: table.y_label,
    unit: table.y_label.split(", ").at(-1),
    curves: table.curves.map((c) => ({ ...c, name: `${when(models[c.model].measured)} ${models[c.model].id}` })) });
}

/** Each value over all accepted models, and each table of the newest ones, with their bands. */
export function valueTrends(place, { models, values, tables }) {
  if (models.length === 0) return;
  const measured = models.map((m) => Date.parse(m.measured));
  const days = measured.map((time) => (time - Math.min(...measured)) / 86400e3);
  place.append(h("h2", {}, "Trend of each value"), h("p", { class: "weak" },
    `${models.length === 1 ? "One accepted model" : `${models.length} accepted models`}, over the days since the first measurement; bands: U (k = 2). ` +
    "Values of models with different volumes or methods are comparable only with care. A click enlarges a chart."));
  for (const group of new Set(values.map((v) => v.group)))
    place.append(h("h3", {}, group), h("div", { class: "small-charts" },
      values.filter((v) => v.group === group).map((v) => valueChart(v, days))));
  if (tables.length)
    place.append(h("h3", {}, "Tables along their axes, of the newest models"), h("div", { class: "small-charts", id: "trend-tables" },
      tables.map((table) => tableChart(table, models))));
}
