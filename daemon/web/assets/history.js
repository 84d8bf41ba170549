// Models with verdicts, events, trends; activation and roll-back.

import { ask } from "./ask.js";
import { h, list, table, when } from "./dom.js";
import { message } from "./message.js";
import { get, listen, post, state } from "./server.js";
import { smallChart } from "./small_charts.js";

const SHOWN_MODELS = 200;  // newest; the others on request, because rows take the browser time

const mayActivate = () => state.me.role === "administer";

async function change(path, body, done, again) {
  try {
    await post(path, body);
    message(done);
  } catch (error) {
    message(error.message);
  }
  await again().catch((error) => message(error.message));
}

async function activate(model, active, again) {
  const why = await ask({ title: `Activate ${model.id}?`, yes: "Activate",
    lines: [active ? `Active now: ${active.id}, added ${when(active.added)}.` : "No model is active now.",
      `Then: ${model.id}, added ${when(model.added)}.`,
      ...(model.simulated ? ["It was made on simulated devices: it describes no real machine."] : []),
      ...(model.accepted ? [] : [model.judged ? "The gate refused this model: it may make the machine worse."
        : "The gate has not judged this model: it may make the machine worse."])],
    reason: "Reason, for the record", required: !model.accepted });
  if (why === null) return;
  await change("api/activate", { id: model.id, why, force: !model.accepted },
    `${model.id} is activated; abbed follows within a second.`, again);
}

// `active`: the model that the page shows as active. The request is refused if it is another one by now.
async function rollBack(active, again) {
  const why = await ask({ title: "Roll back?", yes: "Roll back",
    lines: [active ? `Active now: ${active.id}, added ${when(active.added)}.` : "No model is active now.",
      "Then: the model that was active before it."],
    reason: "Reason, for the record" });
  if (why !== null) await change("api/rollback", { active: active?.id ?? "", why }, "Rolled back.", again);
}

function verdict(model) {
  if (model.fault) return h("span", { class: "bad" }, `damaged: ${model.fault}`);
  const word = model.active ? "active" : model.accepted ? "accepted" : model.judged ? "refused" : "not judged";
  const kind = model.active ? "good" : model.accepted ? "" : "warn";
  return h("div", {}, h("span", { class: kind }, model.active && !model.accepted ? "active (forced)" : word),
    model.simulated ? h("span", { class: "warn" }, " simulated devices") : null,
    model.reasons.length ? list(model.reasons) : null);
}

function modelTable(models, active, again) {
  return table("models", ["model", "added (UTC)", "method", "machine", "verdict", "change"], models.map((m) => [
    m.fault ? m.id : h("a", { href: `#model/${m.id}`, class: "mono" }, m.id), when(m.added), m.method,
    m.machine, verdict(m),
    mayActivate() && !m.active && !m.fault
      ? h("button", { type: "button", "aria-label": `Activate ${m.id}`, onclick: () => activate(m, active, again) }, "Activate") : ""]));
}

// The newest models and the active one; `all`: whether the person asked for the others, too.
function modelTables(models, all, again) {
  const active = models.find((m) => m.active);
  const shown = all.shown ? models : models.filter((m, i) => i < SHOWN_MODELS || m.active);
  const left = models.length - shown.length;
  const more = h("button", { type: "button",
    onclick: () => { all.shown = true; place.replaceChildren(modelTable(models, active, again)); } },
    `Show ${left} older models`);
  const place = h("div", {}, modelTable(shown, active, again), left ? h("p", {}, more) : null);
  return place;
}

function eventTable(events) {
  return table("events", ["when (UTC)", "what", "model", "who", "why"], events.map((e) =>
    [when(e.when), e.action, h("span", { class: "mono" }, e.id), e.who, e.why]));
}

/** Each value over all accepted models, and each table of the newest ones, with their bands. */
function trend(place, { models, values, tables }) {
  if (models.length === 0) return;
  const measured = models.map((m) => Date.parse(m.measured));
  const days = measured.map((time) => (time - Math.min(...measured)) / 86400e3);
  place.append(h("h2", {}, "Trend"), h("p", { class: "weak" },
    `${models.length === 1 ? "One accepted model" : `${models.length} accepted models`}, over the days since the first measurement; bands: U (k = 2). ` +
    "Values of models with different volumes or methods are comparable only with care. A click enlarges a chart."));
  for (const group of new Set(values.map((v) => v.group)))
    place.append(h("h3", {}, group), h("div", { class: "small-charts" },
      values.filter((v) => v.group === group).map((v) => valueChart(v, days))));
  if (tables.length)
    place.append(h("h3", {}, "Tables along their axes, of the newest models"), h("div", { class: "small-charts", id: "trend-tables" },
      tables.map((table) => tableChart(table, models))));
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

const nameOf = (element) => element.getAttribute("aria-label") ?? element.textContent;

export async function show(place) {
  const tables = h("div"), trends = h("div");
  place.append(tables, trends);
  const all = { shown: false };
  let shownHistory = "", trendAnswer = null, shownTrend = "";
  const fill = async () => {
    const answer = await get("api/history");
    if (JSON.stringify(answer) === shownHistory) return;
    shownHistory = JSON.stringify(answer);
    const { models, events } = answer;
    const focused = tables.contains(document.activeElement) ? nameOf(document.activeElement) : null;
    tables.replaceChildren(h("h2", {}, "Models"),
      models.length ? modelTables(models, all, fill) : h("p", {}, "The store has no models yet."),
      mayActivate()
        ? h("p", {}, h("button", { type: "button", onclick: () => rollBack(models.find((m) => m.active), fill) }, "Roll back"))
        : h("p", { class: "weak" }, "To activate a model or roll back, log in with the role administer."),
      h("h2", {}, "Events"), eventTable(events));
    if (focused) [...tables.querySelectorAll("button, a, [tabindex]")].find((e) => nameOf(e) === focused)?.focus();
  };
  // A chart that has the focus, or is enlarged, stays; what has changed is shown when the focus leaves.
  const showTrend = () => {
    const text = JSON.stringify(trendAnswer);
    if (text === shownTrend || trends.contains(document.activeElement) || document.querySelector("dialog.large")) return;
    shownTrend = text;
    const made = h("div");
    trend(made, trendAnswer);
    trends.replaceChildren(made);
  };
  const fillTrend = async () => {
    trendAnswer = await get("api/trend");
    showTrend();
  };
  trends.addEventListener("focusout", () => setTimeout(showTrend));  // until then nothing has the focus
  await fill();
  await fillTrend();
  return listen("store", () => Promise.all([fill(), fillTrend()]).catch((error) => message(error.message)));
}
