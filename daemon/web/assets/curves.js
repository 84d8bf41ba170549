// Curves of the last minutes and hours: axes, temperatures, air, residuals. abbe-web keeps them.
// Address: #curves/5min, #curves/1h or #curves/8h.

import { colourOf, curveChart, onPalette } from "./curve_chart.js";
import { coarser, merged, next, summary, timesOf, valueText, windowOf, windows } from "./curve_data.js";
import { h } from "./dom.js";
import { localTime } from "./local_time.js";
import { get, state } from "./server.js";

const hidden = new Set();  // curves that are switched off, also when the view is opened again
const kMostAge_s = 5;  // of a value that is shown as the present one, besides its step

/** The chart of one group, with a table of its curves; a check box in it switches a curve off. */
async function groupOf(place, group, unit, changed) {
  const chartPlace = h("div"), body = h("tbody");
  const column = (title) => h("th", { scope: "col", class: "number" }, title);
  place.append(h("section", { "aria-label": group }, h("h3", {}, `${group}, ${unit}`), chartPlace,
    h("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": `values: ${group}` },
      h("table", { class: "curve-values" }, h("thead", {}, h("tr", {}, h("th", { scope: "col" }, "curve"), column("latest mean"), column("smallest"), column("largest"))), body))));
  const chart = await curveChart(chartPlace, group, unit);
  const rows = new Map();
  const row = (name) => {
    if (rows.has(name)) return rows.get(name);
    const key = `${group}\n${name}`;
    const swatch = h("span", { class: "swatch", "aria-hidden": "true" });
    const cells = [0, 1, 2].map(() => h("td", { class: "number" }));
    const box = h("input", { type: "checkbox", checked: !hidden.has(key), onchange: () => {
      if (box.checked) hidden.delete(key); else hidden.add(key);
      changed();
    } });
    body.append(h("tr", {}, h("th", { scope: "row" }, h("label", {}, box, swatch, ` ${name}`)), ...cells));
    rows.set(name, { swatch, cells });
    return rows.get(name);
  };
  return { end: chart.end, show: (data, curves, begin_ms, range) => {
    const most = kMostAge_s / data.step_s + 1;
    curves.forEach((curve, i) => {
      const { swatch, cells } = row(curve.name);
      swatch.style.background = colourOf(i);
      const { last, min, max } = summary(curve, most);
      [state.lost ? null : last, min, max].forEach((value, k) => { cells[k].textContent = valueText(value, unit); });
    });
    const shown = coarser({ ...data, curves }, Math.ceil(data.length / Math.max(200, chart.width())));
    const visible = shown.curves.map((curve, i) => ({ curve, colour: colourOf(i) }))
      .filter(({ curve }) => !hidden.has(`${group}\n${curve.name}`));
    chart.show(visible.map((v) => v.curve), visible.map((v) => v.colour), timesOf(shown, begin_ms), 1000 * shown.step_s, range);
  } };
}

export async function show(place) {
  let window = windowOf(location.hash), data = null, ended = false, paused = false;
  let clock = null;  // {begin_ms: of bucket 0, now_ms, at: performance.now() of both}
  const groups = new Map();
  const charts = h("div", { class: "curve-groups" }), notice = h("p", { role: "status" });
  const now_ms = () => (clock ? clock.now_ms + performance.now() - clock.at : Date.now());
  let frozen_ms = null;

  const draw = async () => {
    if (data === null || ended) return;
    const end_ms = frozen_ms ?? now_ms();
    const range = { min: end_ms - 1000 * window.length_s, max: end_ms };
    for (const name of new Set(data.curves.map((c) => c.group))) {
      const curves = data.curves.filter((c) => c.group === name);
      if (!groups.has(name)) groups.set(name, groupOf(charts, name, curves[0].unit, draw));
      // A chart whose script did not load is tried again.
      const group = await groups.get(name).catch((error) => { groups.delete(name); throw error; });
      if (ended) return;
      group.show(data, curves, clock.begin_ms, range);
    }
  };
  const ask = async () => {
    const asked = window;
    const answer = await get(`api/curves/${asked.name}/${next(data)}`);
    if (ended || paused || asked !== window) return;
    const now = Date.parse(answer.now);
    clock = { now_ms: now, begin_ms: now - 1000 * answer.now_s, at: performance.now() };
    data = merged(data, answer);
    notice.textContent = data.curves.length === 0 ? "No values since abbe-web was started." :
      answer.left_out ? "There are more curves than abbe-web keeps: some are not shown." : "";
  };
  const refresh = async () => {
    if (paused || document.hidden) return;
    // Without an answer the axis moves on: what is missing stays open.
    const show = (error) => { if (!state.lost) notice.textContent = error.message; };
    await ask().catch(show);
    await draw().catch(show);
  };

  const choices = windows.map((w) => h("button", { type: "button", "aria-pressed": String(w === window), onclick: () => choose(w) }, w.title));
  const pause = h("button", { type: "button", "aria-pressed": "false", onclick: () => {
    paused = !paused;
    frozen_ms = paused ? now_ms() : null;
    pause.setAttribute("aria-pressed", String(paused));
    pause.textContent = paused ? "Go on" : "Pause";
    notice.textContent = paused ? `Paused at ${localTime(frozen_ms)}; values are still kept.` : "";
    again();
  } }, "Pause");
  let timer = null;
  const again = async () => {
    clearTimeout(timer);
    const began = window;
    await refresh();
    if (ended || began !== window) return;
    clearTimeout(timer);
    timer = setTimeout(again, 1000 * window.period_s);
  };
  const choose = (w) => {
    window = w;
    data = null;
    if (paused) pause.click();
    globalThis.history.replaceState(null, "", `#curves/${w.name}`);
    choices.forEach((b, i) => b.setAttribute("aria-pressed", String(windows[i] === w)));
    again();
  };
  const seen = () => { if (!document.hidden) again(); };
  document.addEventListener("visibilitychange", seen);

  place.append(h("h2", {}, "Curves"), h("div", { class: "tools", role: "group", "aria-label": "time shown" }, choices, pause), notice, charts,
    h("p", { class: "weak" }, "abbe-web keeps these values in its memory while it runs, also when no page is open: the last 8 h. " +
      "A line is the mean of 1 s, 5 s or 40 s, the band behind it reaches from the smallest to the largest value. Where values are missing for more than 3 s the line is open."));
  await again();
  const endPalette = onPalette(() => draw());
  return () => {
    ended = true;
    clearTimeout(timer);
    endPalette();
    document.removeEventListener("visibilitychange", seen);
    for (const group of groups.values()) group.then(({ end }) => end());
  };
}
