// Sound and notification of the browser for what somebody beside the machine must not miss: the next
// touch, READY, a missed start, a refused calibration, a lost connection. Off until a person turns it on,
// because browsers allow neither without a click.

import { h } from "./dom.js";
import { listen, state } from "./server.js";

const kKept = "abbe-signals";
let sound = null;

const on = () => {
  try {
    return localStorage.getItem(kKept) === "on";
  } catch {
    return false; // the browser allows this page no storage
  }
};

/** Browsers let a page sound only after a click or a key: after a reload the first one switches it on. */
const allow = () => {
  if (!on()) return;
  sound ??= new AudioContext();
  sound.resume();
};
document.addEventListener("pointerdown", allow, true);
document.addEventListener("keydown", allow, true);

/** Two short tones; deeper for what is wrong. */
function play(isWrong) {
  sound ??= new AudioContext();
  const begin = sound.currentTime;
  [0, 0.25].forEach((after) => {
    const tone = sound.createOscillator(), volume = sound.createGain();
    tone.frequency.value = isWrong ? 330 : 880;
    volume.gain.setValueAtTime(0.3, begin + after);
    volume.gain.exponentialRampToValueAtTime(0.001, begin + after + 0.2);
    tone.connect(volume).connect(sound.destination);
    tone.start(begin + after);
    tone.stop(begin + after + 0.2);
  });
}

function signal(text, isWrong) {
  if (!on()) return;
  document.body.dataset.signal = text;
  play(isWrong);
  if (globalThis.Notification?.permission !== "granted") return;
  try {
    new Notification(`abbe ${document.getElementById("machine").textContent}`, { body: text, tag: "abbe", renotify: true });
  } catch {
    // Chromium on Android shows notifications of service workers only: the sound remains.
  }
}

/** What a status asks of the person beside the machine: [text, is it wrong]; null: nothing. */
function demand({ session }) {
  if (session.state === "refused" && session.reason.startsWith("cancelled")) return null;
  if (session.state === "refused") return [`Calibration refused: ${session.reason}`, true];
  if (session.start?.missed) return [session.reason, true];
  if (session.start?.ready) return ["READY: drive the path now", false];
  if (session.next) return [`Next: ${session.next.on}`, false];
  return null;
}

let last;  // what was asked for last; undefined: no status yet
listen("status", (status) => {
  if (!status) return;
  const now = demand(status);
  const key = now ? `${status.session.id} ${now[0]}` : "";
  if (last !== undefined && now && key !== last) signal(...now);
  last = key;
});
let wasLost = state.lost !== null;
listen("lost", (reason) => {
  if (reason !== null && !wasLost) signal(`Lost: ${reason}`, true);
  wasLost = reason !== null;
});

/** The switch. */
export function signalSwitch() {
  const box = h("input", { type: "checkbox", id: "signals", checked: on() });
  box.addEventListener("change", async () => {
    localStorage.setItem(kKept, box.checked ? "on" : "off");
    if (!box.checked) return;
    play(false);
    if (globalThis.Notification?.permission === "default") await Notification.requestPermission();
  });
  return h("label", {}, box, " Sound and notification: next touch, READY, start missed, refused, connection lost");
}
