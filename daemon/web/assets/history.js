// Models with verdicts, events, trends; activation and roll-back.

import { ask } from "./ask.js";
import { draw } from "./charts.js";
import { h, list, table, when } from "./dom.js";
import { message } from "./main.js";
import { get, listen, post, state } from "./server.js";

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
      ...(model.accepted ? [] : ["The gate refused this model: it may make the machine worse."])],
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
  const word = model.active ? "active" : model.accepted ? "accepted" : "refused";
  const kind = model.active ? "good" : model.accepted ? "" : "warn";
  return h("div", {}, h("span", { class: kind }, model.active && !model.accepted ? "active (forced)" : word),
    model.reasons.length ? list(model.reasons) : null);
}

function modelTable(models, again) {
  const active = models.find((m) => m.active);
  return table("models", ["model", "added (UTC)", "method", "machine", "verdict", "change"], models.map((m) => [
    m.fault ? m.id : h("a", { href: `#model/${m.id}`, class: "mono" }, m.id), when(m.added), m.method,
    m.machine, verdict(m),
    mayActivate() && !m.active && !m.fault
      ? h("button", { type: "button", "aria-label": `Activate ${m.id}`, onclick: () => activate(m, active, again) }, "Activate") : ""]));
}

function eventTable(events) {
  return table("events", ["when (UTC)", "what", "model", "who", "why"], events.map((e) =>
    [when(e.when), e.action, h("span", { class: "mono" }, e.id), e.who, e.why]));
}

/** One value over all accepted models, with its band. */
async function trend(place) {
  const { models, values } = await get("api/trend");
  if (models.length === 0 || values.length === 0) return () => {};
  const first = Date.parse(models[0].created);
  const days = models.map((m) => (Date.parse(m.created) - first) / 86400e3);
  const select = h("select", { id: "trend-choice" },
    values.map((v) => h("option", { value: v.key }, `${v.name}, ${v.unit}`)));
  const chart = h("div");
  place.append(h("h2", {}, "Trend"), h("div", { class: "tools" },
    h("label", { for: "trend-choice" }, "Value"), select), chart,
    h("p", { class: "weak" }, "Accepted models only. Values of models with different volumes or methods are comparable only with care."));
  let end = () => {};
  const show = async () => {
    end();
    end = () => {};
    chart.replaceChildren();
    const v = values.find((value) => value.key === select.value);
    const known = v.value.map((value, i) => [days[i], value, v.u[i]]).filter(([, value]) => value !== null);
    end = await draw(chart, { title: v.name, x_label: "days since the first model", y_label: v.unit,
      curves: [{ name: v.name, dots: true, x: known.map((k) => k[0]), y: known.map((k) => k[1]), u: known.map((k) => k[2]) }] });
  };
  select.addEventListener("change", show);
  await show();
  return () => end();
}

export async function show(place) {
  const tables = h("div"), trends = h("div");
  place.append(tables, trends);
  const fill = async () => {
    const { models, events } = await get("api/history");
    tables.replaceChildren(h("h2", {}, "Models"),
      models.length ? modelTable(models, fill) : h("p", {}, "The store has no models yet."),
      mayActivate()
        ? h("p", {}, h("button", { type: "button", onclick: () => rollBack(models.find((m) => m.active), fill) }, "Roll back"))
        : h("p", { class: "weak" }, "To activate a model or roll back, log in with the role administer."),
      h("h2", {}, "Events"), eventTable(events));
  };
  let endTrend = () => {};
  const fillTrend = async () => {
    endTrend();
    trends.replaceChildren();
    endTrend = await trend(trends);
  };
  await fill();
  await fillTrend();
  const stop = listen("store", () => Promise.all([fill(), fillTrend()]).catch((error) => message(error.message)));
  return () => { stop(); endTrend(); };
}
