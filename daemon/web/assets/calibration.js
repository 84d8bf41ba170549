// The calibration under way: state, path or artefact, what was noticed, and how to begin one.

import { ask } from "./ask.js";
import { fixed, h, list, table } from "./dom.js";
import { identificationView, identifyButton, mayIdentify } from "./identify.js";
import { isSameRecording } from "./identify_options.js";
import { get, listen, post, state } from "./server.js";
import { message, withdraw } from "./message.js";
import { methodInWords, running, stateInWords } from "./session_words.js";
import { signalSwitch } from "./signals.js";
import { Space } from "./space.js";

const may = () => ["calibrate", "administer"].includes(state.me.role);

/** What a calibration with touches asks for next. */
function nextTouch(next) {
  if (!next) return [];
  const of = next.measurement ? `measurement ${next.measurement}` : `position ${next.position}`;
  const features = next.features ?? [];
  const touched = features.filter((f) => f.touched >= f.points).length;
  return [h("p", {}, h("strong", { class: "large" }, `Next: ${next.on}`), ` of ${of}; `,
    `${next.touched} of ${next.points} points touched`,
    features.length ? `; ${touched} of ${features.length} balls and blocks of this position are complete` : "")];
}

/** The verdict of the gate, a line for each sentence. */
function verdictParts({ figures, reasons, notes }) {
  return [
    ...(reasons.length ? [h("h2", {}, "Reasons against the model"), list(reasons)] : []),
    h("p", {}, figures),
    ...(notes.length ? [h("h2", {}, "To know about this model"), list(notes)] : []),
  ];
}

/** What a run along a path needs before the machine may drive off. */
function startParts(session) {
  const { start, verdict } = session;
  if (verdict) return verdictParts(verdict);
  if (!start) return [h("p", {}, session.reason)];
  return [
    start.ready ? h("p", { class: "large good", role: "status" }, session.reason) : null,
    start.missed ? h("p", { class: "alarm", role: "alert" }, session.reason) : null,
    !start.ready && !start.missed ? h("p", {}, session.reason) : null,
    h("ul", { class: "checks", id: "start" }, start.conditions.map((c) =>
      h("li", { class: c.met ? "good" : "warn", "data-name": c.name, "data-met": String(c.met) },
        h("strong", {}, c.met ? "\u2713 " : "\u2717 "), c.text))),
  ];
}

function liveTables(live) {
  if (!live) return [];
  const rows = live.tables.map((t) => {
    const known = t.value.map((v, i) => [v, t.u[i]]).filter(([v]) => typeof v === "number");
    const largest = Math.max(...known.map(([v]) => Math.abs(v)));
    const unit = t.unit === "rad" ? "urad" : "um";
    return [h("th", { scope: "row" }, t.table), `${known.length} of ${t.value.length}`,
      known.length ? `${fixed(1e6 * largest, 2)} ${unit}` : "-",
      known.length ? `${fixed(1e6 * Math.max(...known.map(([, u]) => u)), 2)} ${unit}` : "-"];
  });
  return [h("h2", {}, `Tables so far, of ${live.samples} points`),
    table("tables so far", ["table", "nodes determined", { title: "largest value", number: true },
      { title: "largest u", number: true }], rows)];
}

function sessionParts(session) {
  const minutes = session.remaining_s === undefined ? "" : `, about ${fixed(session.remaining_s / 60, 1)} min left`;
  const held = session.held_out_rms_um;
  const again = session.again ? [h("p", {}, "To identify this run again, with other options: ",
    h("code", { id: "again" }, session.again))] : [];
  return [
    h("p", {}, h("strong", {}, stateInWords(session)), ` (${methodInWords(session)}), ${session.points} points${minutes}`),
    running(session) ? h("progress", { max: 1, value: session.progress, "aria-label": "progress" }) : null,
    ...startParts(session),
    ...again,
    held && !session.verdict ? h("p", {}, `Held-out residuals: ${fixed(held.candidate, 3)} um with the model, ` +
      `${fixed(held.no_compensation, 3)} um without.`) : null,
    ...nextTouch(session.next),
    ...(session.notes.length ? [h("h2", {}, "Noticed"), list(session.notes)] : []),
    ...liveTables(session.live),
  ].filter((part) => part !== null);
}

/** The touches of a session: `next`, the one that is asked for, null: none; `last`, the one that was
 * asked for last while this view was open; `end`, how the session has ended: "complete", "cancelled",
 * "refused"; empty: it has not, or that is not known. */
function touchesOf(session, last) {
  const next = session?.next ?? null;
  if (!session || next) return { next, last: next ?? last, end: "" };
  const isComplete = ["identifying", "judged", "active"].includes(session.state) || session.model_id !== "";
  return { next, last, end: isComplete ? "complete" : session.reason.startsWith("cancelled") ? "cancelled" : "refused" };
}

const kEnds = {
  complete: "Complete: all touches were made.",
  cancelled: "The calibration was cancelled.",
  refused: "The calibration has ended without a model.",
};
const kNotKnown = "What was touched is not known: this view was opened later.";

/** `id`: of the session that is drawn. Calls `show` with its touches, now and whenever they change. */
function followTouches(id, show) {
  let touches = touchesOf(null, null);
  const follow = (status) => {
    if (status?.session.id === id) touches = touchesOf(status.session, touches.last);
    return show(touches);
  };
  return { end: listen("status", follow), first: follow(state.status) };
}

/** The first three axes in mm; null while one of them is not known. */
function place_mm(positions_m) {
  const known = (positions_m ?? []).slice(0, 3).filter((x) => typeof x === "number");
  return known.length === 3 ? known.map((x) => 1e3 * x) : null;
}

const distance = (a, b) => Math.hypot(...a.map((x, i) => x - b[i]));

function corners(points) {
  const of = (pick) => [0, 1, 2].map((i) => pick(...points.map((p) => p[i])));
  return [of(Math.min), of(Math.max)];
}

/** The path to drive and the driven path; returns what ends it. */
async function pathView(place, path_mm, driven_mm) {
  const space = await Space.create(place, ...corners(path_mm), "Path to drive and driven path");
  space.path(path_mm, "open");
  const draw = space.growingPath("next");
  let driven = 0, last = null;
  const drive = (at) => {
    draw(at);
    last = at;
    space.frame.dataset.driven = ++driven;
  };
  driven_mm.forEach(drive);
  let ball = null;
  const show = (at) => {
    ball ??= space.ball(at, 0.012 * space.size, "touched");
    ball.position.set(...at);
    space.draw();
  };
  const least = space.size / 500;
  let shown = null;
  const follow = (positions_m) => {
    const at = place_mm(positions_m);
    if (!at || (shown && distance(at, shown) < least)) return;
    shown = at;
    if (state.status?.session.state === "acquiring" && !(last && distance(at, last) < least)) drive(at);
    show(at);
  };
  follow(state.live);
  const stop = listen("live", follow);
  return () => { stop(); space.end(); };
}

const mm = (metres) => metres.map((x) => 1e3 * x);
const along = (v, n) => v.reduce((sum, x, i) => sum + x * n[i], 0);

/** Balls and blocks with their places, mm, and their state: "open", "begun", "touched". They stand in
 * the machine (`posed`) as soon as the touches of the position show all of them; until then in the frame
 * of the array. Its file states in which direction a block faces, not where it is: it is drawn beside the
 * balls in this direction. */
function featuresOf(calibrator, { last, end }) {
  const seen = new Map((last?.features ?? []).map((f) => [f.on, f]));
  const posed = seen.size > 0 && [...seen.values()].every((f) => f.at_m && (f.normal || f.on.startsWith("ball")));
  const stateOf = (on) => {
    const f = seen.get(on);
    if (end === "complete" || (f && f.touched >= f.points)) return "touched";
    return f?.touched > 0 ? "begun" : "open";
  };
  const centres = calibrator.balls.map((b) => mm(b.centre_m));
  const centre = [0, 1, 2].map((i) => centres.reduce((sum, c) => sum + c[i], 0) / centres.length);
  const radius = 1e3 * Math.max(...calibrator.balls.map((b) => b.radius_m));
  const balls = calibrator.balls.map((b) => ({ on: `ball ${b.number}`, name: String(b.number), radius: 1e3 * b.radius_m }))
    .map((b, i) => ({ ...b, at: posed ? mm(seen.get(b.on).at_m) : centres[i], state: stateOf(b.on) }));
  const blocks = calibrator.blocks.map((b) => {
    const on = `block ${b.number}`, length = Math.hypot(...b.normal);
    const out = b.normal.map((x) => x / length);
    const reach = Math.max(...centres.map((c) => along(c, out))) - along(centre, out) + 3 * radius;
    return { on, name: `block ${b.number}`, side: 2 * radius, state: stateOf(on),
      at: posed ? mm(seen.get(on).at_m) : centre.map((x, i) => x + reach * out[i]),
      normal: posed ? seen.get(on).normal : out };
  });
  return { posed, all: [...balls, ...blocks], radius };
}

/** What tells two drawings apart: the machine with its position of the array, or the array alone. */
const frameOf = ({ posed }, { last }) => (posed ? `position ${last.position}` : "array");

/** "Next: ball 3. Touched: ball 1, block 1", for a screen reader; `verb`: "Touched". */
function touchesInWords({ next, last, end }, verb, done) {
  if (end === "complete") return kEnds.complete;
  return [next ? `Next: ${next.on}.` : kEnds[end] ?? "", last ? `${verb}: ${done.join(", ") || "nothing"}` : ""]
    .filter((part) => part !== "").join(" ");
}

/** What the drawing of the array shows; see arrayDrawing(). */
function drawingInWords({ posed }, { next, last, end }) {
  const parts = [];
  if (end) parts.push(kEnds[end]);
  if (end !== "complete") {
    if (last) parts.push("Outline: not touched yet. Green outline: begun. Filled: touched.");
    else if (end) parts.push(kNotKnown);
  }
  if (next) parts.push("Orange and larger: touched next.");
  if (posed) parts.push(`The array as it stands in the machine at position ${last.position}${next ? ", with the tip" : ""}.`);
  else parts.push("The array in its own frame, with the blocks beside it" + (next ?
    ": where it stands is known once both blocks and the first balls are touched." : "."));
  return parts.join(" ");
}

/** The array once, with what is touched and what is next; `arm`: see Space.create(). */
async function arrayDrawing(place, features, frame, arm = [-0.5, -1, 0.6]) {
  const margin = 2 * features.radius;
  const [low, high] = corners(features.all.map((f) => f.at));
  const space = await Space.create(place, low.map((x) => x - margin), high.map((x) => x + margin), "Ball array", arm);
  const names = new Map(features.all.map((f) => [f.on,
    space.text(f.name, new THREE.Vector3(f.at[0], f.at[1], f.at[2] + 2.2 * (f.radius ?? f.side / 2)))]));
  space.frame.dataset.frame = frame;
  let drawn = [], tip = null;
  const mark = ({ all, posed }, touches) => {
    drawn.forEach((object) => space.remove(object));
    drawn = all.map((f) => {
      const isNext = f.on === touches.next?.on;
      const name = names.get(f.on);
      if (name) name.userData.first = isNext;
      const role = isNext ? "next" : f.state === "open" ? "open" : "touched";
      const outline = !isNext && f.state !== "touched", larger = isNext ? 1.3 : 1;
      return f.normal ? space.plate(f.at, f.normal, larger * f.side, role, outline)
        : space.ball(f.at, larger * f.radius, role, outline);
    });
    const inState = (state) => all.filter((f) => f.state === state).map((f) => f.on);
    Object.assign(space.frame.dataset, { next: touches.next?.on ?? "", end: touches.end,
      begun: inState("begun").join(), touched: inState("touched").join() });
    space.name(`Ball array ${posed ? "in the machine" : "in its own frame"}. ` +
      touchesInWords(touches, "Touched", inState("touched")));
  };
  const showTip = ({ next }) => {
    const at = features.posed && next ? place_mm(state.live) : null;
    if (!at) return;
    tip ??= space.ball(at, 0.25 * features.radius, "tip");
    tip.position.set(...at);
    space.draw();
  };
  return { space, frame, mark, showTip };
}

/** The balls and blocks of an array, with the one that is to be touched next; returns what ends it. */
async function artefactView(place, calibrator, id) {
  const words = h("p", { class: "weak" });
  const view = h("div");
  place.append(view, words);
  let drawing = null, shown = "", ended = false, busy = false;
  const draw = async (touches) => {
    const features = featuresOf(calibrator, touches);
    const frame = frameOf(features, touches);
    if (drawing?.frame !== frame) {
      const arm = drawing?.space.arm;
      drawing?.space.end();
      drawing = null;
      view.replaceChildren();
      const made = await arrayDrawing(view, features, frame, arm);
      if (ended) return made.space.end();
      drawing = made;
    }
    drawing.mark(features, touches);
    drawing.showTip(touches);
    words.textContent = drawingInWords(features, touches);
  };
  let touches = null;
  const show = async (now) => {
    touches = now;
    if (busy) return;
    busy = true;
    for (let key = ""; !ended && (key = JSON.stringify(touches)) !== shown;) {
      shown = key;
      await draw(touches).catch((error) => { words.textContent = error.message; });
    }
    busy = false;
  };
  const { end, first } = followTouches(id, show);
  await first;
  const ends = [end, listen("live", () => drawing?.showTip(touches))];
  return () => {
    ended = true;
    ends.forEach((each) => each());
    drawing?.space.end();
  };
}

/** The planned places of a Multi-Feature Bar, with the one that is to be touched next. */
async function barView(place, bars, id) {
  const space = await Space.create(place, ...corners(bars.flatMap((b) => b.holes_mm)),
    "Places of the bar");
  let shown = null, drawn = [];
  const mark = (touches) => {
    const key = JSON.stringify(touches);
    if (key === shown) return;
    shown = key;
    const { next, last, end } = touches;
    const done = end === "complete" ? bars.length : last ? last.place - 1 : 0;  // in the order of the plan
    drawn.forEach((object) => space.remove(object));
    drawn = [];
    bars.forEach((bar, i) => {
      const isNext = bar.measurement === next?.measurement;
      const role = isNext ? "next" : i < done ? "touched" : "open";
      drawn.push(space.path(bar.holes_mm, role), space.dots(bar.holes_mm, role, isNext ? 0.014 : i < done ? 0.012 : 0.006));
      const hole = isNext && bar.holes_mm[Number(/^hole (\d+)/.exec(next.on)?.[1]) - 1];
      if (hole) drawn.push(space.ball(hole, 0.02 * space.size, "next"));
    });
    const asked = next ? { on: `${next.measurement} ${next.on}` } : null;
    Object.assign(space.frame.dataset, { next: asked?.on ?? "", end, done });
    space.name(`Places of the bar. ${touchesInWords({ next: asked, last, end }, "Done", bars.slice(0, done).map((b) => b.measurement))}`);
  };
  const { end } = followTouches(id, mark);
  return () => { end(); space.end(); };
}

async function drawing(place) {
  const { session, request, driven_mm, bars } = await get("api/calibration");
  place.replaceChildren();
  if (request?.path_m?.length > 1)
    return pathView(place, request.path_m.map((p) => p.map((x) => 1e3 * x)), driven_mm);
  if (request?.calibrator) return artefactView(place, request.calibrator, session);
  if (bars.length > 0) return barView(place, bars, session);
  return () => {};
}

async function attempt(request, done) {
  try {
    await request();
    message(done);
  } catch (error) {
    message(error.message);
  }
}

/** A file that the user chooses; `read` returns it as abbe-web expects it, undefined: none. */
function fileField(id, words, accept, required) {
  const input = h("input", { type: "file", id, accept });
  const read = async () => {
    const file = input.files[0];
    if (file) return { file: file.name, text: await file.text() };
    if (required) throw new Error(`choose a file: ${words}`);
    return undefined;
  };
  return { parts: [h("label", { for: id }, words), input], read };
}

const begun = {
  otf: "The calibration has begun: let the machine stand at the first vertex, then drive the path.",
  evemu: "The calibration has begun: touch the array as shown.",
  mfb: "The calibration has begun: touch the bar as shown.",
};

/** The fields of each method: [{parts, read}] with `read` for the request. */
function fieldsOf(method) {
  if (method === "otf") {
    const mode = h("select", { id: "path-mode" },
      h("option", { value: "" }, "as configured"),
      h("option", { value: "on-the-fly" }, "on the fly"),
      h("option", { value: "standstill" }, "standstill"));
    return { path: fileField("path-file", "Path (path.csv)", ".csv", true),
      mode: { parts: [h("label", { for: "path-mode" }, "Mode"), mode],
        read: () => mode.value || undefined } };
  }
  if (method === "mfb")
    return { bar: fileField("bar-file", "Bar (bar.toml)", ".toml", true),
      plan: fileField("plan-file", "Plan (plan.toml)", ".toml", true) };
  const u = h("input", { type: "number", id: "reference-u", min: "0.01", step: "any" });
  return { calibrator: fileField("calibrator-file", "Ball array (calibrator.toml)", ".toml", true),
    reference: fileField("reference-file",
      "Points where V is known, which determine the rotation (errors.csv, optional)", ".csv", false),
    u_reference_um: { parts: [h("label", { for: "reference-u" },
      "Standard uncertainty of that V, um"), u], read: () => u.value === "" ? undefined : Number(u.value) } };
}

/** The button that ends the running calibration; above the view, so that a hand finds it. */
function cancelButton() {
  const cancel = async () => {
    const sure = await ask({ title: "Cancel the running calibration?", yes: "Cancel the calibration",
      lines: ["What is recorded stays in its recording."] });
    if (sure !== null) await attempt(() => post("api/cancel"), "The calibration is cancelled.");
  };
  return h("p", { class: "tools" },
    h("button", { type: "button", onclick: cancel }, "Cancel the calibration"));
}

function newCalibration() {
  const method = h("select", { id: "method" },
    h("option", { value: "otf" }, "on the fly with a laser tracker"),
    h("option", { value: "evemu" }, "ball array"),
    h("option", { value: "mfb" }, "Multi-Feature Bar"));
  const place = h("div");
  let fields = {};
  const choose = () => {
    fields = fieldsOf(method.value);
    place.replaceChildren(...Object.values(fields).flatMap((field) => field.parts));
  };
  method.addEventListener("change", choose);
  choose();
  const begin = () => attempt(async () => {
    const request = { method: method.value };
    for (const [name, field] of Object.entries(fields)) request[name] = await field.read();
    await post("api/calibrate", request);
  }, begun[method.value]);
  return h("section", {}, h("h2", {}, "New calibration"),
    h("label", { for: "method" }, "Method"), method, place,
    h("p", { class: "tools" },
      h("button", { type: "button", class: "strong", onclick: begin }, "Begin")));
}

/** Below a session that has ended: identifies its run again. Returns {show, end}. */
function againView(place) {
  const button = h("p", { class: "tools" }), result = h("div");
  place.append(button, result);
  let recording = "";
  const identification = identificationView(result, (now) => isSameRecording(now.name, recording));
  const show = (session) => {
    if ((session.recording ?? "") === recording) return;
    recording = session.recording ?? "";
    button.replaceChildren(...(recording && mayIdentify()
      ? [identifyButton(recording, session.method, identification.follow)] : []));
    identification.follow().catch(() => {});
  };
  return { show, end: identification.end };
}

export async function show(place) {
  const parts = h("div"), again = h("div"), view = h("div"), above = h("div"), below = h("div");
  place.append(h("h2", {}, "Calibration"), above, parts, again, view, below, signalSwitch());
  const { show: showAgain, end: endAgain } = againView(again);
  let shownControls = null;
  // Cancel while a calibration runs, Begin while none does.
  const showControls = (isRunning) => {
    if (isRunning === shownControls) return;
    shownControls = isRunning;
    above.replaceChildren(...(isRunning && may() ? [cancelButton()] : []));
    below.replaceChildren(isRunning ? "" : may() ? newCalibration()
      : h("p", { class: "weak" }, "To begin or cancel a calibration, log in with the role calibrate."));
  };
  showControls(state.status ? running(state.status.session) : false);
  let before = state.status?.session.state, shown = "";
  const onStatus = (status) => {
    if (!status) return;
    const now = status.session.state;
    showControls(running(status.session));
    showAgain(status.session);
    // Twice a second: "warming" may lie between two.
    if (["acquiring", "identifying"].includes(now) || (before === "warming" && now !== before))
      withdraw(Object.values(begun));
    before = now;
    // Drawn anew only when it has changed: so a command can be selected, and is read aloud once.
    const latest = JSON.stringify(status.session);
    if (latest === shown || parts.contains(document.activeElement)) return;
    shown = latest;
    parts.replaceChildren(...sessionParts(status.session));
  };
  if (state.status) onStatus(state.status);

  let endDrawing = () => {}, ended = false, drawings = 0;
  const redraw = async () => {
    endDrawing();
    endDrawing = () => {};
    const number = ++drawings;
    try {
      const end = await drawing(view);
      if (ended || number !== drawings) end();
      else endDrawing = end;
    } catch (error) {
      view.replaceChildren(h("p", { class: "warn" }, error.message));
    }
  };
  await redraw();
  const ends = [listen("status", onStatus), listen("calibration", redraw), endAgain];
  return () => {
    ended = true;
    ends.forEach((end) => end());
    endDrawing();
  };
}
