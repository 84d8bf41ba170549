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

/** The answer as JSON; throws an Error with the text of the server. */
export async function get(path) {
  return read(await fetch(path, { credentials: "same-origin" }));
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

// The server sends an event at least once a second.
const kSilence_ms = 3000;
let events = null;
let lastEvent = 0;
let sourceFault = "";

function onEvent() {
  lastEvent = performance.now();
  report(sourceFault === "" ? null : `abbed does not answer: ${sourceFault}`);
}

function report(lost) {
  if (lost === state.lost) return;
  state.lost = lost;
  notify("lost", lost);
}

function on(name, take) {
  events.addEventListener(name, (event) => {
    const value = JSON.parse(event.data);
    take(value);
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
}

/** The reason why the server gives no stream. */
async function explainRefusal() {
  const answer = await fetch("events").catch(() => null);
  if (answer?.ok === false) report((await answer.json().catch(() => ({}))).error ?? answer.statusText);
  await answer?.body?.cancel();
}

/** Opens the stream; called again, it opens a new one. */
export function connect() {
  events?.close();
  events = new EventSource("events");
  lastEvent = performance.now();
  on("source", (source) => {
    sourceFault = source.alive ? "" : source.reason;
    if (!source.alive) state.status = state.live = null;
  });
  on("status", (status) => { state.status = status; });
  on("live", (positions) => { state.live = positions; });
  for (const name of ["alive", "calibration", "store"]) on(name, () => {});
  events.addEventListener("error", () => {
    report("no connection to abbe-web: the values are not current");
    // After an answer that is not a stream (too many pages) the browser does not try again.
    if (events?.readyState !== EventSource.CLOSED) return;
    explainRefusal();
    setTimeout(() => { if (events) connect(); }, 2000);
  });
}

setInterval(() => {
  if (events && performance.now() - lastEvent > kSilence_ms)
    report("abbe-web has sent nothing for 3 s: the values are not current");
}, 500);
