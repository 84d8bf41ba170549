// One model, or one beside another: verdict, error motions with bands, the field in space, residuals,
// signs, what it does not know. Address: #model/ID or #model/ID/OTHER.

import { draw } from "./charts.js";
import { facts, fixed, h, list, table, when } from "./dom.js";
import { get, listen } from "./server.js";
import { Space } from "./space.js";

const kLongest = 0.12;  // of the diagonal of the box: the longest vector of the field

/** `number` of the residuals: lengths, so that their mean is not near 0. */
function residuals(model) {
  const row = (what, f) => [h("th", { scope: "row" }, what), fixed(f.mean_um, 3), fixed(f.rms_um, 3), fixed(f.max_um, 3)];
  const r = model.residuals;
  const number = (title) => ({ title, number: true });
  const parts = [h("h2", {}, "Before and after"),
    table("residuals of the fit", ["residuals of the fit, um", number("mean length"), number("rms"), number("largest")],
      [row("before", r.before), row("after", r.after)])];
  if (r.held_out?.before_um > 0)
    parts.push(h("p", {}, `Held-out ${r.held_out.what}, not used in the fit: ` +
      `${fixed(r.held_out.before_um, 3)} um rms without compensation, ` +
      `${fixed(r.held_out.after_um, 3)} um with the model.`));
  return parts;
}

function alongPath(model) {
  const run = model.residuals.along_path;
  if (!run || run.at_m.length === 0) return [];
  return [{ title: "Residuals along the path, rms", x_label: "length of the path, m", y_label: "um",
    curves: [{ name: "before", x: run.at_m, y: run.before_um },
             { name: "after", x: run.at_m, y: run.after_um }] }];
}

/** The lamp of the report; its text also states the colour. */
function verdict({ lamp, text, reasons, notes }) {
  const lamps = h("span", { class: "lamps", "aria-hidden": "true" },
    ["red", "yellow", "green"].map((colour) => h("span", { class: colour === lamp ? `lamp ${colour}` : "lamp" })));
  const under = (title, items) => (items.length ? h("div", {}, h("h3", {}, title), list(items)) : null);
  return h("section", { id: "verdict", "data-lamp": lamp }, h("h2", {}, "Verdict"),
    h("div", { class: "signal" }, lamps, h("strong", {}, text)),
    h("div", { class: "columns" }, under("Reasons against it", reasons),
      under("To know about this model", notes)));
}

/** Shows the present verdict of the model: a later run may have found drift, or it was activated. */
async function followVerdict(place, id) {
  const { verdict: now } = await get(`api/models/${id}`);
  place.querySelector("#verdict").replaceWith(verdict(now));
}

function signs(model) {
  return h("section", { id: "signs" }, h("h2", {}, "Signs"), list(model.signs));
}

function unknowns(model) {
  return h("div", { class: "columns" },
    h("section", {}, h("h2", {}, "What it does not know"), list(model.not_estimable)),
    h("section", {}, h("h2", {}, "What the uncertainty does not contain"),
      list(model.not_in_the_uncertainty)));
}

/** The values of the standards; of two models beside each other. */
function values(model, other) {
  const text = (v) => (v ? v.value || "not estimable" : "-");
  const number = (title) => ({ title, number: true });
  return model.values.map((group) => {
    const others = other?.values.find((g) => g.name === group.name)?.values ?? [];
    const beside = (v) => others.find((o) => o.name === v.name);
    const columns = ["", number(other ? model.id : "value"), number("U (k = 2)"),
      ...(other ? [number(other.id), number("U (k = 2)")] : []), "unit"];
    return h("details", {}, h("summary", {}, group.name), h("p", { class: "weak" }, group.explanation),
      table(group.name, columns, group.values.map((v) => [h("th", { scope: "row" }, v.name), text(v), v.U,
        ...(other ? [text(beside(v)), beside(v)?.U ?? ""] : []), v.value ? v.unit : v.why])));
  });
}

/** The value of a curve between its nodes; undefined outside them. */
function valueAt(curve, y, x) {
  const i = curve.x.findIndex((node) => node >= x - 1e-9);
  if (i < 0 || x < curve.x[0] - 1e-9) return undefined;
  if (i === 0) return y[0];
  const part = Math.min((x - curve.x[i - 1]) / (curve.x[i] - curve.x[i - 1]), 1);
  return y[i - 1] + part * (y[i] - y[i - 1]);
}

/** The curve of the same error motion of another model. */
const counterpart = (curve, other) =>
  other.charts.flatMap((c) => c.curves).find((c) => c.key === curve.key);

/** Each error motion of both models in one chart. */
function together(model, other) {
  return model.charts.flatMap((chart) => chart.curves.map((curve) => {
    const beside = counterpart(curve, other);
    const named = (c, id) => ({ ...c, name: `${c.key} of ${id}` });
    return { ...chart, title: curve.key,
      curves: [named(curve, model.id), ...(beside ? [named(beside, other.id)] : [])] };
  }));
}

/** Model minus other, with the uncertainty of both as if they were independent. */
function difference(model, other) {
  return model.charts.map((chart) => ({ ...chart, y_label: chart.y_label.replace("error", "difference"),
    curves: chart.curves.flatMap((curve) => {
      const beside = counterpart(curve, other);
      if (!beside) return [];
      const nodes = curve.x.map((x, i) => [x, curve.y[i] - valueAt(beside, beside.y, x),
        Math.hypot(curve.u[i], valueAt(beside, beside.u, x))]).filter(([, y]) => Number.isFinite(y));
      return nodes.length === 0 ? [] : [{ name: curve.key, x: nodes.map((n) => n[0]), y: nodes.map((n) => n[1]),
        u: nodes.map((n) => n[2]) }];
    }) })).filter((chart) => chart.curves.length > 0);
}

/** The chart with U = 2 u in place of the error. */
function ofU(chart) {
  return { ...chart, y_label: chart.y_label.replace("error", "U"),
    curves: chart.curves.map((c) => ({ name: c.name, x: c.x, y: c.u.map((u) => 2 * u) })) };
}

/** Error motions with bands, or U alone, which a narrow band does not show; of two models together, or
 * their difference. */
async function motionView(place, model, other) {
  const choice = h("select", { id: "motion-choice" },
    other ? [h("option", { value: "together" }, "both models, each with its band of U (k = 2)"),
      h("option", { value: "difference" }, `${model.id} minus ${other.id}`)] : null,
    h("option", { value: "error" }, "error with its band of U (k = 2)"),
    h("option", { value: "U" }, "U (k = 2) alone"));
  const charts_of = { together: () => together(model, other), difference: () => difference(model, other),
    error: () => [...model.charts, ...alongPath(model)], U: () => model.charts.map(ofU) };
  const charts = h("div", { class: "charts" });
  place.append(model.charts.length > 0
    ? h("div", { class: "tools" }, h("label", { for: "motion-choice" }, "Show"), choice)
    : h("p", {}, "A model of polynomials has no tables of error motions."), charts);
  let ends = [];
  const show = async () => {
    ends.forEach((end) => end());
    ends = [];
    charts.replaceChildren();
    for (const chart of charts_of[choice.value]()) ends.push(await draw(charts, chart));
  };
  choice.addEventListener("change", show);
  await show();
  return () => ends.forEach((end) => end());
}

/** The largest |V|, and the factor from um to mm in the scene. */
function scaleOf(field) {
  const lengths = field.vectors.map((v) => Math.hypot(...v.V_um));
  const diagonal = Math.hypot(...field.high_mm.map((x, i) => x - field.low_mm[i]));
  const longest = Math.max(...lengths, 1e-9);
  return { longest, factor: kLongest * diagonal / longest };
}

/** V of `field` minus V of `other` at the places that both have. */
function fieldDifference(field, other) {
  const key = (v) => v.at_mm.map((x) => x.toFixed(3)).join();
  const theirs = new Map(other.vectors.map((v) => [key(v), v]));
  return { ...field, vectors: field.vectors.filter((v) => theirs.has(key(v))).map((v) => {
    const beside = theirs.get(key(v));
    return { ...v, V_um: v.V_um.map((x, i) => x - beside.V_um[i]), U_um: Math.hypot(v.U_um, beside.U_um) };
  }) };
}

/** The field of the model, or its difference to that of another one. */
async function spaceView(place, model, other) {
  if (!other?.field || !model.field) return fieldView(place, model.field);
  const field = fieldDifference(model.field, other.field);
  if (field.vectors.length === 0) {
    place.append(h("p", {}, "The two models have different volumes: their fields have no place in common."));
    return () => {};
  }
  place.append(h("p", {}, `V of ${model.id} minus V of ${other.id}. U: of both, as if they were independent.`));
  return fieldView(place, field, { before: "difference of V", after: "U (k = 2) of the difference" });
}

/** The field of V, or the spheres of U that remain after compensation, at the same scale. */
async function fieldView(place, field, words = { before: "before: V, the error without compensation",
  after: "after: U (k = 2), what remains uncertain" }) {
  if (!field || field.vectors.length === 0) {
    place.append(h("p", {}, "The model has no validity volume."));
    return () => {};
  }
  const { longest, factor } = scaleOf(field);
  const largestU = Math.max(...field.vectors.map((v) => v.U_um));
  const choice = h("select", { id: "field-choice" },
    h("option", { value: "before" }, words.before), h("option", { value: "after" }, words.after),
    h("option", { value: "both" }, "both, at the same scale"));
  const hull = h("input", { type: "checkbox", id: "field-hull", checked: true });
  place.append(h("div", { class: "tools" },
    h("label", { for: "field-choice" }, "Show"), choice,
    h("label", { for: "field-hull" }, hull, " validity volume")),
    h("p", { class: "weak" }, `Longest V ${fixed(longest, 1)} um, largest U ${fixed(largestU, 2)} um; ` +
      `drawn ${fixed(1000 * factor, 0)} times larger than in the machine.`));

  const space = await Space.create(place, field.low_mm, field.high_mm, "Field of the error in the machine");
  const at = (v, share) => v.at_mm.map((x, i) => x + share * factor * v.V_um[i]);
  let drawn = [];
  const show = () => {
    drawn.forEach((object) => space.remove(object));
    drawn = [];
    if (hull.checked) drawn.push(space.hull(field.hull_mm, "open"));
    if (choice.value !== "after") {
      drawn.push(space.dots(field.vectors.map((v) => v.at_mm), "point"));
      drawn.push(space.segments(field.vectors.map((v) => [v.at_mm, at(v, 1)]), "error"));
    }
    if (choice.value !== "before")
      for (const v of field.vectors)
        drawn.push(space.ball(v.at_mm, Math.max(factor * v.U_um, 0.0012 * space.size), "uncertainty"));
    space.draw();
  };
  choice.addEventListener("change", show);
  hull.addEventListener("change", show);
  show();
  return () => space.end();
}

/** Options for the models of the store; the one that is shown, and the one beside it, are chosen. */
async function chooser(id, beside) {
  const models = (await get("api/history")).models.filter((m) => !m.fault);
  if (models.length === 0) return null;
  const active = models.find((m) => m.active);
  const shown = id === "active" ? (active ?? models[0]).id : id;
  const option = (m, chosen) => h("option", { value: m.id, selected: m.id === chosen },
    `${m.id}, ${when(m.added)}, ${m.active ? "active" : m.accepted ? "accepted" : "refused"}`);
  const select = h("select", { id: "model-choice" }, models.map((m) => option(m, shown)));
  const compare = h("select", { id: "compare-choice" }, h("option", { value: "" }, "no other model"),
    models.filter((m) => m.id !== shown).map((m) => option(m, beside)));
  const go = () => { location.hash = ["model", select.value, compare.value].filter((part) => part).join("/"); };
  select.addEventListener("change", () => { if (compare.value === select.value) compare.value = ""; go(); });
  compare.addEventListener("change", go);
  const state = (m) => m && `${m.id}${m.active}${m.accepted}`;
  const changed = async () => {
    const { models: now } = await get("api/history");
    return state(now.find((m) => m.id === shown)) !== state(models.find((m) => m.id === shown)) ||
      (id === "active" && now.find((m) => m.active)?.id !== active?.id);
  };
  return { select, compare, shown, changed, noneActive: id === "active" && !active };
}

function origin(model) {
  return facts("model", [
    ["model", model.id], ["identified (UTC)", when(model.created)], ["method", model.method],
    ["machine", `${model.machine}, chain ${model.chain}`], ["tools", model.tools],
    ["solution", `${model.observations} observations, ${model.unknowns} unknowns, rank ` +
      `${model.rank}, condition ${model.condition.toPrecision(3)}, sigma0 ${fixed(model.sigma0, 3)}`],
    ["datum", model.datum],
    ["inputs", model.inputs.map((i) => i.name).join(", ")]]);
}

export async function show(place) {
  const [, id, beside] = location.hash.split("/");
  const choice = await chooser(id ?? "active", beside);
  if (choice === null) {
    place.append(h("p", {}, "The store has no models yet: run a calibration."));
    return () => {};
  }
  const [model, other] = await Promise.all([get(`api/models/${choice.shown}`),
    choice.compare.value ? get(`api/models/${choice.compare.value}`) : null]);
  const notice = h("p", { class: "warn", role: "status" },
    choice.noneActive ? "No model is active; the newest one is shown." : "");
  place.append(notice,
    h("div", { class: "tools" }, h("label", { for: "model-choice" }, "Model"), choice.select,
      h("label", { for: "compare-choice" }, "Compare with"), choice.compare,
      h("a", { href: `reports/${choice.shown}`, target: "_blank" }, "Report to print"),
      h("a", { href: `models/${choice.shown}`, download: "model.json" }, "model.json")),
    verdict(model.verdict), origin(model), ...residuals(model), h("h2", {}, "The error in space"));
  const space = h("div");
  const motions = h("div");
  place.append(space, h("h2", {}, "Error motions"), motions, unknowns(model), signs(model),
    h("h2", {}, "Values of the standards"), ...values(model, other));

  const ends = [listen("store", async () => {
    if (await choice.changed().catch(() => false))
      notice.textContent = "The models have changed since this view was opened: open it again.";
    await followVerdict(place, choice.shown).catch((error) => { notice.textContent = error.message; });
  }), await motionView(motions, model, other)];
  try {
    ends.push(await spaceView(space, model, other));
  } catch (error) {
    space.append(h("p", { class: "warn" }, `This browser draws no 3-D view: ${error.message}`));
  }
  return () => ends.forEach((end) => end());
}
