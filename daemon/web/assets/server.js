// The connection to abbe-web: requests, and the stream of events.

/** What the server reported last. */
export const state = { status: null, live: null, me: { may_view: true }, lost: "connecting" };

const listeners = new Map();

/** Calls `listener` at every event of the topic; returns the function that ends this. */
export function listen(topic, listener) {
  if (!listeners.has(topic)) listeners.set(topic, new Set());
  listeners.get(topic).add(listener);
  return () => listeners.get(topic).delete(listener);
}

function notify(topic, value) {
  for (const listener of listeners.get(topic) ?? []) listener(value);
}

// What the page asks by itself, for example after an event, must not keep a user logged in who has left.
const kAttended_ms = 60_000;
let lastInput = performance.now();
for (const name of ["pointerdown", "keydown", "wheel"])
  globalThis.addEventListener?.(name, () => { lastInput = performance.now(); }, { capture: true, passive: true });

/** The answer as JSON; throws an Error with the text of the server. */
export async function get(path) {
  const attended = performance.now() - lastInput < kAttended_ms;
  return read(await fetch(path, { credentials: "same-origin", headers: attended ? {} : { "X-Unattended": "1" } }));
}

export async function post(path, body = {}) {
  const headers = { "Content-Type": "application/json" };
  if (state.me.csrf) headers["X-CSRF-Token"] = state.me.csrf;
  return read(await fetch(path, {
    method: "POST", credentials: "same-origin", headers, body: JSON.stringify(body),
  }));
}

async function read(response) {
  let answer = null;
  try {
    answer = await response.json();
  } catch {
    throw new Error(`${response.status} ${response.statusText}`);
  }
  if (response.status === 401 && state.me.user) notify("logged out", null);
  if (!response.ok) throw new Error(answer.error ?? response.statusText);
  return answer;
}

// The server sends an event at least once a second, and positions several times a second.
const kSilence_ms = 3000;
let events = null;
let lastEvent = 0, lastValue = 0;
let sourceFault = "";
let connectionFault = state.lost;  // until the next event

// The server gives the place of a page that does not report that it reads to another one that needs it.
const kReport_ms = 5000;
let place = null, lastReport = 0;

function reportReading() {
  if (place === null || performance.now() - lastReport < kReport_ms) return;
  lastReport = performance.now();
  fetch(`api/reading/${place}`, { credentials: "same-origin", headers: { "X-Unattended": "1" } }).catch(() => {});
}

function onEvent() {
  lastEvent = performance.now();
  reportReading();
  connectionFault = "";
  report(whyLost());
}

/** 3, 4, ... 9, 10, 20, ...: a text that changes is read aloud. */
function roughSeconds(since) {
  const s = Math.floor((performance.now() - since) / 1000);
  return s < 10 ? s : 10 * Math.floor(s / 10);
}

/** Why the values are not current; null: they are. */
function whyLost() {
  if (connectionFault !== "") return connectionFault;
  if (performance.now() - lastEvent > kSilence_ms)
    return `abbe-web has sent nothing for ${roughSeconds(lastEvent)} s: the values are not current`;
  if (sourceFault !== "") return `abbed does not answer: ${sourceFault}`;
  if (performance.now() - lastValue > kSilence_ms)
    return `no new value for ${roughSeconds(lastValue)} s: the positions are not current`;
  return null;
}

function report(lost) {
  if (lost === state.lost) return;
  state.lost = lost;
  notify("lost", lost);
}

function on(name, take) {
  events.addEventListener(name, (event) => {
    let value = null;
    try {
      value = JSON.parse(event.data);
      take(value);
    } catch (error) {
      connectionFault = `abbe-web sent an event that the page does not understand: ${error.message}`;
      report(whyLost());
      return;
    }
    onEvent();
    notify(name, value);
  });
}

/** Ends the stream: nothing may be shown before a log in. */
export function disconnect() {
  events?.close();
  events = null;
  state.status = state.live = null;
  report(null);
  notify("notice", { text: "" });
}

/** The reason why the server gives no stream. */
async function explainRefusal() {
  const answer = await fetch("events").catch(() => null);
  if (answer?.ok === false) {
    connectionFault = (await answer.json().catch(() => ({}))).error ?? answer.statusText;
    if (events) report(whyLost());
  }
  await answer?.body?.cancel();
}

/** Opens the stream; called again, it opens a new one. */
export function connect() {
  events?.close();
  events = new EventSource("events");
  lastEvent = lastValue = performance.now();
  on("place", ({ number }) => { place = number; lastReport = -kReport_ms; });
  on("source", (source) => {
    sourceFault = source.alive ? "" : source.reason;
    if (!source.alive) state.status = state.live = null;
  });
  on("status", (status) => { state.status = status; });
  on("live", (positions) => {
    state.live = Array.isArray(positions) ? positions : null;
    if (state.live) lastValue = performance.now();
  });
  for (const name of ["alive", "calibration", "store", "notice"]) on(name, () => {});
  events.addEventListener("error", () => {
    connectionFault = "no connection to abbe-web: the values are not current";
    report(whyLost());
    // After an answer that is not a stream (too many pages) the browser does not try again.
    if (events?.readyState !== EventSource.CLOSED) return;
    explainRefusal();
    setTimeout(() => { if (events) connect(); }, 2000);
  });
}

setInterval(() => {
  if (events) report(whyLost());
}, 500);
