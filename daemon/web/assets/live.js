// Axes, streams and environment.

import { facts, fixed, h, table } from "./dom.js";
import { listen, state } from "./server.js";
import { stateInWords } from "./session_words.js";

const kDegrees = 180 / Math.PI;

/** One card for each axis; returns the function that shows positions (m or rad). */
function axisCards(place, axes) {
  const values = axes.map((axis) => {
    const rotary = axis.kind === "rotary";
    const value = h("span", {}, "-");
    place.append(h("div", { class: "axis", role: "group", "aria-label": `axis ${axis.axis}` },
      h("div", { class: "name" }, axis.axis),
      h("div", { class: "value current" }, value,
        h("span", { class: "unit" }, rotary ? " \u00b0" : " mm")),
      axis.missing ? h("div", { class: "warn" }, axis.missing) : ""));
    return { value, factor: rotary ? kDegrees : 1e3 };
  });
  return (positions) => values.forEach(({ value, factor }, i) => {
    const at = positions?.[i];
    value.textContent = typeof at === "number" ? (factor * at).toFixed(4) : "-";
  });
}

function streamRow(stream) {
  const good = stream.connected ? "good" : "warn";
  return [
    h("th", { scope: "row" }, stream.name),
    h("span", { class: good }, stream.state),
    h("td", { class: "sentence" }, [stream.condition, stream.last_fault].filter(Boolean).join("; ")),
    fixed(stream.rate_hz, 1), String(stream.samples), String(stream.dropped), String(stream.gaps),
    String(stream.faults ?? 0),
  ];
}

// What a telephone shows without scrolling comes first.
const streamColumns = ["stream", "state", "last fault", { title: "rate, 1/s", number: true },
  { title: "samples", number: true }, { title: "dropped", number: true },
  { title: "gaps", number: true }, { title: "faults", number: true }];

function environment(status) {
  const e = status.environment;
  if (!e) return [];
  return [h("h2", {}, "Environment"), facts("environment", [
    ["air temperature", `${fixed(e.air_temperature_C, 2)} \u00b0C`],
    ["air pressure", `${fixed(e.air_pressure_hPa, 2)} hPa`],
    ["relative humidity", `${fixed(e.relative_humidity_percent, 1)} %`],
    ...Object.entries(e.temperatures_C ?? {}).map(([name, t]) => [name, `${fixed(t, 2)} \u00b0C`]),
  ])];
}

/** The file, and how far it is behind the machine. */
function recording(status) {
  const recorder = status.streams.find((stream) => stream.behind_s !== undefined);
  if (!status.recording || !recorder) return status.recording;
  return `${status.recording}, ${fixed(recorder.behind_s, 1)} s behind`;
}

function state_of(status) {
  const dds = status.dds;
  return facts("state", [
    ["model", `${status.model.id ?? "-"}: ${status.model.reason}`],
    ["session", stateInWords(status.session)],
    ["recording", recording(status)],
    ["DDS", dds ? `${dds.connected ? "connected" : "not connected"}, ${dds.sent} messages` : ""],
    ["release", status.release_awaited?.reason],
    ["clock", status.clock?.join("; ")],
    ["stop", status.machine_stop ? `${status.machine_stop.outcome}: ${status.machine_stop.text}` : ""],
    ["axes not referenced", status.axes_without_zero?.join(", ")],
    ["tracker", status.unmeasured_air],
  ]);
}

export function show(place) {
  const cards = h("div", { class: "axes" });
  const streams = h("div"), below = h("div");
  place.append(h("h2", {}, "Axes"), cards, h("h2", {}, "Streams"), streams, below);
  let showPositions = () => {};
  let axesShown = "", pending = false;
  const showLatest = () => showPositions(state.lost ? null : state.live);

  const onStatus = (status) => {
    if (!status) return;
    const names = JSON.stringify(status.axes);
    if (names !== axesShown) {
      axesShown = names;
      cards.replaceChildren();
      showPositions = axisCards(cards, status.axes);
      showLatest();
    }
    // A table that has the focus, for scrolling, is replaced later.
    if (!streams.contains(document.activeElement))
      streams.replaceChildren(table("streams", streamColumns, status.streams.map(streamRow)),
        ...(status.identity ? [h("p", {}, `Identity of the machine: ${status.identity.machine_id || "-"}`)] : []));
    if (!below.contains(document.activeElement))
      below.replaceChildren(h("h2", {}, "State"), state_of(status), ...environment(status));
  };
  // At most once per frame of the display.
  const onLive = () => {
    if (pending) return;
    pending = true;
    requestAnimationFrame(() => {
      pending = false;
      showLatest();
    });
  };

  if (state.status) onStatus(state.status);
  onLive();
  const ends = [listen("status", onStatus), listen("live", onLive),
    listen("lost", (lost) => { if (lost) showPositions(null); })];
  return () => ends.forEach((end) => end());
}
