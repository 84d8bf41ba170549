// The trend of the volumetric error, models with verdicts, events, all trends; activation and roll-back.
// Address: #history/search=WORDS&method=NAME&verdict=NAME&from=DAY&to=DAY&page=NUMBER, each part if chosen.

import { ask } from "./ask.js";
import { h, list, localWhen, table } from "./dom.js";
import { message } from "./message.js";
import { filterOf, hashOf, kPerPage, matching, noFilter, pageOf, verdicts } from "./model_list.js";
import { get, listen, post, state } from "./server.js";
import { valueTrends, volumeTrend } from "./trend.js";
import { localTime } from "./local_time.js";

const kShownEvents = 20;  // newest; the others on request

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
    lines: [active ? `Active now: ${active.id}, added ${localTime(Date.parse(active.added))}.` : "No model is active now.",
      `Then: ${model.id}, added ${localTime(Date.parse(model.added))}.`,
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
    lines: [active ? `Active now: ${active.id}, added ${localTime(Date.parse(active.added))}.` : "No model is active now.",
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
  return table("models", ["model", "verdict", "added", "method", "machine", "change"], models.map((m) => [
    m.fault ? m.id : h("a", { href: `#model/${m.id}`, class: "mono" }, m.id), verdict(m), localWhen(m.added),
    m.method, m.machine,
    mayActivate() && !m.active && !m.fault
      ? h("button", { type: "button", "aria-label": `Activate ${m.id}`, onclick: () => activate(m, active, again) }, "Activate") : ""]));
}

/** Search and filter; `changed` is called with the new filter, on its first page. */
function filterForm(filter, methods, changed) {
  const choice = (name, label, values, none) => h("label", {}, label,
    h("select", { name, onchange: () => take() }, h("option", { value: "" }, none),
      values.map((v) => h("option", { value: v, selected: v === filter[name] }, v))));
  const day = (name, label) => h("label", {}, label,
    h("input", { name, type: "date", value: filter[name], onchange: () => take() }));
  const form = h("form", { class: "filter", role: "search", "aria-label": "models", onsubmit: (event) => event.preventDefault() },
    h("label", {}, "Search", h("input", { name: "search", type: "search", value: filter.search, maxlength: 200,
      placeholder: "model, machine, reason", oninput: () => take() })),
    choice("method", "Method", methods, "every method"), choice("verdict", "Verdict", verdicts, "every verdict"),
    day("from", "Added from"), day("to", "Added until"),
    h("button", { type: "button", onclick: () => { clear(); changed(noFilter()); } }, "Show all"));
  const clear = () => { for (const name of ["search", "method", "verdict", "from", "to"]) form.elements[name].value = ""; };
  const take = () => changed({ ...noFilter(), search: form.elements.search.value, method: form.elements.method.value,
    verdict: form.elements.verdict.value, from: form.elements.from.value, to: form.elements.to.value });
  return form;
}

/** "Models 21 to 40 of 93, of 500 in all" */
function countInWords({ page, models }, found, all) {
  if (all === 0) return "The store has no models yet.";
  if (found === 0) return `None of ${all} models matches.`;
  const first = (page - 1) * kPerPage + 1;
  return `Models ${first} to ${first + models.length - 1} of ${found}${found < all ? `, of ${all} in all` : ""}, newest first`;
}

/** The list of models with its filter and pages; returns the function that shows the answer of the server. */
function modelList(place, again) {
  let filter = filterOf(location.hash), answer = null, methods = null;
  const formPlace = h("div"), tablePlace = h("div"), roll = h("div");
  const count = h("p", { id: "model-count", role: "status" });
  const turn = (by) => { filter.page += by; showPage(); };
  const newer = h("button", { type: "button", onclick: () => turn(-1) }, "Newer models");
  const older = h("button", { type: "button", onclick: () => turn(1) }, "Older models");
  const where = h("span", {});
  place.append(h("h2", {}, "Models"), formPlace, count, tablePlace,
    h("div", { class: "tools", id: "model-pages" }, newer, where, older), roll);

  const showPage = () => {
    const found = matching(answer.models, filter);
    const page = pageOf(found, filter.page);
    filter.page = page.page;
    globalThis.history.replaceState(null, "", hashOf(filter));
    const active = answer.models.find((m) => m.active);
    count.textContent = countInWords(page, found.length, answer.models.length) +
      (answer.left_out ? `. ${answer.left_out} older ones are not listed here: abbe model list` : "");
    tablePlace.replaceChildren(...(page.models.length ? [modelTable(page.models, active, again)] : []));
    where.textContent = `Page ${page.page} of ${page.pages}`;
    const focused = document.activeElement;
    newer.disabled = page.page === 1;
    older.disabled = page.page === page.pages;
    // A button that is switched off loses the focus: the other one gets it.
    if (focused === newer && newer.disabled) older.focus();
    if (focused === older && older.disabled) newer.focus();
  };
  return (now) => {
    answer = now;
    const names = [...new Set([...now.models.map((m) => m.method), filter.method])].filter((m) => m).sort();
    if (JSON.stringify(names) !== methods) {
      methods = JSON.stringify(names);
      formPlace.replaceChildren(filterForm(filter, names, (chosen) => { filter = chosen; showPage(); }));
    }
    showPage();
    roll.replaceChildren(mayActivate()
      ? h("p", {}, h("button", { type: "button", onclick: () => rollBack(now.models.find((m) => m.active), again) }, "Roll back"))
      : h("p", { class: "weak" }, "To activate a model or roll back, log in with the role administer."));
  };
}

function eventTable(events) {
  return table("events", ["when", "what", "model", "who", "why"], events.map((e) =>
    [localWhen(e.when), e.action, h("span", { class: "mono" }, e.id), e.who, e.why]));
}

/** The newest events; `all`: whether the person asked for the others, too. */
function showEvents(place, events, all) {
  const left = all.shown ? 0 : Math.max(0, events.length - kShownEvents);
  const more = h("button", { type: "button", onclick: () => { all.shown = true; showEvents(place, events, all); } },
    `Show ${left} older events`);
  place.replaceChildren(h("h2", {}, "Events"), eventTable(left ? events.slice(0, kShownEvents) : events),
    ...(left ? [h("p", {}, more)] : []));
}

const nameOf = (element) => element.getAttribute("aria-label") ?? element.getAttribute("name") ?? element.textContent;

export async function show(place) {
  const volume = h("div", { class: "first-chart" }), models = h("div"), events = h("div"), trends = h("div");
  place.append(h("h2", {}, "Trend"), volume, models, events, trends);
  const all = { shown: false };
  let shownHistory = "", trendAnswer = null, shownTrend = "", ended = false, removeVolume = () => {};
  const fill = async () => {
    const answer = await get("api/history");
    if (ended || JSON.stringify(answer) === shownHistory) return;
    shownHistory = JSON.stringify(answer);
    const focused = place.contains(document.activeElement) ? document.activeElement : null;
    showModels(answer);
    showEvents(events, answer.events, all);
    if (focused && !focused.isConnected)
      [...place.querySelectorAll("button, a, input, select, [tabindex]")].find((e) => nameOf(e) === nameOf(focused))?.focus();
  };
  const showModels = modelList(models, fill);
  // A chart that has the focus, or is enlarged, stays; what has changed is shown when the focus leaves.
  const showTrend = async () => {
    const text = JSON.stringify(trendAnswer);
    if (ended || text === shownTrend || trends.contains(document.activeElement) || document.querySelector("dialog.large")) return;
    shownTrend = text;
    const made = h("div");
    valueTrends(made, trendAnswer);
    trends.replaceChildren(made);
    removeVolume();
    removeVolume = () => {};
    const chart = h("div");
    volume.replaceChildren(chart);
    const remove = await volumeTrend(chart, trendAnswer);
    if (chart.isConnected) removeVolume = remove;
    else remove();
  };
  const fillTrend = async () => {
    trendAnswer = await get("api/trend");
    await showTrend();
  };
  trends.addEventListener("focusout", () => setTimeout(showTrend));  // until then nothing has the focus
  await fill();
  await fillTrend();
  const unlisten = listen("store", () => Promise.all([fill(), fillTrend()]).catch((error) => message(error.message)));
  return () => {
    ended = true;
    unlisten();
    removeVolume();
  };
}
