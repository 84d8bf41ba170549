// The frame of the page: views by the part of the address behind "#", states, log in.

import { h } from "./dom.js";
import { message } from "./message.js";
import { connect, disconnect, get, listen, post, state } from "./server.js";
import { stateInWords } from "./session_words.js";
import "./signals.js";

const views = {
  live: () => import("./live.js"),
  curves: () => import("./curves.js"),
  calibration: () => import("./calibration.js"),
  model: () => import("./model.js"),
  history: () => import("./history.js"),
  recordings: () => import("./recordings.js"),
  configuration: () => import("./configuration.js"),
};
const find = (id) => document.getElementById(id);
let leave = () => {};
let shown = 0;  // counts the calls of show()

/** Shows the view of the address. A view has show(place), which returns what ends it. */
async function show() {
  const name = location.hash.slice(1).split("/")[0] || "live";
  const load = views[name] ?? views.live;
  const number = ++shown;
  const place = h("div");
  message("");
  for (const dialog of document.querySelectorAll("dialog[open]")) dialog.close();  // of the view that ends
  for (const link of document.querySelectorAll("nav a")) {
    if (link.getAttribute("href") === `#${name}`) link.setAttribute("aria-current", "page");
    else link.removeAttribute("aria-current");
  }
  try {
    let view = null, fault = null;
    try {
      view = await load();
    } catch (error) {
      fault = error;
    }
    if (number !== shown) return;
    leave();
    leave = () => {};
    find("view").replaceChildren(place);
    if (fault) throw fault;
    document.title = `abbe: ${name}`;
    if (!state.me.may_view) {
      place.append(h("p", {}, "Log in to see this page."));
      return;
    }
    const end = await view.show(place);
    if (number === shown) leave = end ?? (() => {});
    else end?.();
  } catch (error) {
    if (number === shown) place.append(h("p", { class: "bad" }, error.message));
  }
  find("view").dataset.ready = name;
}

listen("lost", (reason) => {
  document.body.classList.toggle("lost", reason !== null);
  find("connection").hidden = reason === null;
  find("connection").textContent = reason ?? "";
});

// A task for the administrator, for example an expiring certificate.
listen("notice", ({ text }) => {
  find("notice").hidden = text === "";
  find("notice").textContent = text;
});

listen("status", (status) => {
  if (!status) return;
  const danger = status.streams.map((stream) => stream.condition ?? "")
    .filter((condition) => condition.startsWith("the machine may be moving"));
  find("danger").hidden = danger.length === 0;
  find("danger").textContent = danger.join("; ");
  find("stop").hidden = !status.measuring_machine || !state.me.csrf;
  find("machine").textContent = status.machine;
  const model = status.model;
  const simulated = status.simulated ? "Simulated devices" : model.simulated ? "Model of simulated devices" : "";
  find("simulated").hidden = simulated === "";
  find("simulated").replaceChildren(h("strong", { class: "warn" }, simulated));
  const good = model.state === "ACTIVE" ? "good" : model.state === "INVALID" ? "bad" : "warn";
  find("model-state").replaceChildren("Model ", h("strong", { class: good }, model.state));
  find("model-state").title = model.reason;
  const session = status.session;
  find("session-state").textContent = `Calibration: ${stateInWords(session)}`;
  find("session-state").dataset.state = session.state;
});

function showUser() {
  const button = find("log-in");
  button.hidden = !state.me.log_in;
  button.textContent = state.me.user ? `Log out ${state.me.user}` : "Log in";
}

async function changeUser(me) {
  state.me = me;
  showUser();
  if (me.may_view) connect();
  else disconnect();
  await show();
}

find("log-in").addEventListener("click", async () => {
  if (!state.me.user) {
    find("log-in-fault").textContent = "";
    find("log-in-dialog").showModal();
    return;
  }
  await post("api/logout").catch(() => {});
  await get("api/me").then(changeUser, (error) => message(error.message));
});
find("stop").addEventListener("click", async () => {
  try {
    const stop = await post("api/stop");
    message(`Machine stopped: ${stop.text}`);
  } catch (error) {
    message(error.message);
  }
});
find("log-in-cancel").addEventListener("click", () => find("log-in-dialog").close());
find("log-in-form").addEventListener("submit", async (event) => {
  event.preventDefault();
  const form = event.target;
  try {
    const me = await post("api/login", { user: form.user.value, password: form.password.value });
    form.reset();
    find("log-in-dialog").close();
    await changeUser(me);
  } catch (error) {
    find("log-in-fault").textContent = error.message;
  }
});

function nameThemeButton() {
  find("theme").textContent = document.documentElement.dataset.theme === "dark" ? "Light" : "Dark";
}
find("theme").addEventListener("click", changeTheme);
addEventListener("theme", nameThemeButton);
nameThemeButton();

find("skip").addEventListener("click", (event) => {
  event.preventDefault();
  find("view").focus();
});
// The session has ended, or its role has changed.
listen("logged out", () => get("api/me").then(changeUser, () => {}));
addEventListener("hashchange", show);
get("api/me").then(changeUser, (error) => message(error.message));
