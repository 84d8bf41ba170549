// The calibration under way: state, path or artefact, what was noticed, and how to begin one.

import { ask } from "./ask.js";
import { fixed, h, list, table } from "./dom.js";
import { get, listen, post, state } from "./server.js";
import { message } from "./main.js";
import { Space } from "./space.js";

const running = (session) => ["warming", "acquiring", "identifying", "judged"].includes(session.state);
const may = () => ["calibrate", "administer"].includes(state.me.role);

/** What a calibration with touches asks for next. */
function nextTouch(next) {
  if (!next) return [];
  const of = next.measurement ? `measurement ${next.measurement}` : `position ${next.position}`;
  return [h("p", {}, h("strong", {}, `Next: ${next.on}`), ` of ${of}; `,
    `${next.touched} of ${next.points} points touched`)];
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
  return [
    h("p", {}, h("strong", {}, session.state), ` (${session.method}), ${session.points} points${minutes}`),
    running(session) ? h("progress", { max: 1, value: session.progress, "aria-label": "progress" }) : null,
    h("p", {}, session.reason),
    held ? h("p", {}, `Held-out residuals: ${fixed(held.candidate, 3)} um with the model, ` +
      `${fixed(held.no_compensation, 3)} um without.`) : null,
    ...nextTouch(session.next),
    ...(session.notes.length ? [h("h2", {}, "Noticed"), list(session.notes)] : []),
    ...liveTables(session.live),
  ].filter((part) => part !== null);
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
  space.path(path_mm, 0x6e7f90);
  const driven = [...driven_mm];
  let line = null, ball = null;
  const redraw = () => {
    space.remove(line);
    if (driven.length > 1) line = space.path(driven, 0xe69f00);
    const at = place_mm(state.live);
    if (at) {
      ball ??= space.ball(at, 0.012 * space.size, 0x2fd3a0);
      ball.position.set(...at);
    }
    space.draw();
  };
  redraw();
  const least = space.size / 500;
  let shown = null;
  const stop = listen("live", (positions_m) => {
    const at = place_mm(positions_m);
    if (!at || (shown && distance(at, shown) < least)) return;
    shown = at;
    const last = driven.at(-1);
    if (state.status?.session.state === "acquiring" && !(last && distance(at, last) < least)) driven.push(at);
    redraw();
  });
  return () => { stop(); space.end(); };
}

/** The balls of an array, with the one that is to be touched next; returns what ends it. */
async function artefactView(place, balls) {
  const at = balls.map((b) => b.at_mm);
  const space = await Space.create(place, ...corners(at), "Ball array with the next ball");
  const radius = balls[0].radius_mm > 0 ? balls[0].radius_mm : 0.02 * space.size;
  const drawn = balls.map((b) => {
    space.text(String(b.number), new THREE.Vector3(b.at_mm[0], b.at_mm[1], b.at_mm[2] + 2.2 * radius));
    return space.ball(b.at_mm, radius, 0x6e7f90);
  });
  const mark = () => {
    const on = state.status?.session.next?.on ?? "";
    drawn.forEach((ball, i) => ball.material.color.set(on === `ball ${balls[i].number}` ? 0xe69f00 : 0x6e7f90));
    space.draw();
  };
  mark();
  const stop = listen("status", mark);
  return () => { stop(); space.end(); };
}

/** The planned places of a Multi-Feature Bar, with the one that is to be touched next. */
async function barView(place, bars) {
  const space = await Space.create(place, ...corners(bars.flatMap((b) => b.holes_mm)),
    "Places of the bar with the next hole");
  for (const bar of bars) {
    space.path(bar.holes_mm, 0x6e7f90);
    space.dots(bar.holes_mm, 0x6e7f90, 0.008);
  }
  let shown = "", drawn = [];
  const mark = () => {
    const next = state.status?.session.next;
    const now = next ? `${next.measurement} ${next.on}` : "";
    if (now === shown) return;
    shown = now;
    drawn.forEach((object) => space.remove(object));
    drawn = [];
    const bar = bars.find((b) => b.measurement === next?.measurement);
    if (!bar) return;
    drawn.push(space.path(bar.holes_mm, 0xe69f00), space.dots(bar.holes_mm, 0xe69f00, 0.014));
    const hole = bar.holes_mm[Number(/^hole (\d+)/.exec(next.on)?.[1]) - 1];
    if (hole) drawn.push(space.ball(hole, 0.02 * space.size, 0xe69f00));
  };
  mark();
  const stop = listen("status", mark);
  return () => { stop(); space.end(); };
}

/** The balls in the request of a calibration with a ball array; empty: it has none. */
function ballsOf(request) {
  return (request?.calibrator?.balls ?? []).map((b) => ({
    number: b.number, at_mm: b.centre_m.map((x) => 1e3 * x), radius_mm: 1e3 * b.radius_m,
  }));
}

async function drawing(place) {
  const { request, driven_mm, bars } = await get("api/calibration");
  place.replaceChildren();
  const balls = ballsOf(request);
  if (request?.path_m?.length > 1)
    return pathView(place, request.path_m.map((p) => p.map((x) => 1e3 * x)), driven_mm);
  if (balls.length > 1) return artefactView(place, balls);
  if (bars.length > 0) return barView(place, bars);
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
  const u = h("input", { type: "number", id: "reference-u", min: "0.01", step: "any", value: "1" });
  return { calibrator: fileField("calibrator-file", "Ball array (calibrator.toml)", ".toml", true),
    reference: fileField("reference-file",
      "Points where V is known, which determine the rotation (errors.csv, optional)", ".csv", false),
    u_reference_um: { parts: [h("label", { for: "reference-u" },
      "Standard uncertainty of that V, um"), u], read: () => Number(u.value) } };
}

function controls() {
  if (!may())
    return h("p", { class: "weak" }, "To begin or cancel a calibration, log in with the role calibrate.");
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
  const cancel = async () => {
    const sure = await ask({ title: "Cancel the running calibration?", yes: "Cancel the calibration",
      lines: ["What is recorded stays in its recording."] });
    if (sure !== null) await attempt(() => post("api/cancel"), "The calibration is cancelled.");
  };
  return h("section", {}, h("h2", {}, "New calibration"),
    h("label", { for: "method" }, "Method"), method, place,
    h("p", { class: "tools" },
      h("button", { type: "button", class: "strong", onclick: begin }, "Begin"),
      h("button", { type: "button", onclick: cancel }, "Cancel the calibration")));
}

export async function show(place) {
  const parts = h("div"), view = h("div");
  place.append(h("h2", {}, "Session"), parts, view, controls());
  const onStatus = (status) => {
    if (status && !parts.contains(document.activeElement)) parts.replaceChildren(...sessionParts(status.session));
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
  const ends = [listen("status", onStatus), listen("calibration", redraw)];
  return () => {
    ended = true;
    ends.forEach((end) => end());
    endDrawing();
  };
}
