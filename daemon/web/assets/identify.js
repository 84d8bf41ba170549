// A recorded run identified again: the button and its dialog, progress, verdict, and the way into the store.

import { ask } from "./ask.js";
import { h, list } from "./dom.js";
import { conditionsOf, identificationInWords, methods, optionsOf, requestOf, smoothnessFault } from "./identify_options.js";
import { message } from "./message.js";
import { get, post, state } from "./server.js";

const kPoll_ms = 1000;

export const mayIdentify = () => ["calibrate", "administer"].includes(state.me.role);

const select = (id, choices) =>
  h("select", { id }, choices.map(([value, words]) => h("option", { value }, words)));

function optionField({ name, label, choices }) {
  const id = `identify-${name.replace("_", "-")}`;
  const input = choices ? select(id, choices) : h("input", { id, maxlength: 100, autocomplete: "off" });
  if (!choices) input.addEventListener("input", () => input.setCustomValidity(smoothnessFault(input.value)));
  return { name, input, parts: [h("label", { for: id }, label), input] };
}

function conditionField([name, words]) {
  const input = h("input", { type: "checkbox", name });
  return { name, input, part: h("label", { class: "check" }, input, `${name}: ${words}`) };
}

/** The fields of the dialog; `read` returns the request. `method`: null: the person chooses it. */
function fieldsFor(name, method) {
  const place = h("div", { class: "fields" });
  const chosen = select("identify-method", methods);
  let options = [], conditions = [];
  const fill = () => {
    const of = method ?? chosen.value;
    options = optionsOf(of).map(optionField);
    conditions = conditionsOf(of).map(conditionField);
    place.replaceChildren(...options.flatMap((option) => option.parts),
      h("fieldset", {}, h("legend", {}, "Accept, although the gate would refuse it"), conditions.map((c) => c.part)));
  };
  chosen.addEventListener("change", fill);
  fill();
  const read = () => requestOf(name, method ?? chosen.value,
    Object.fromEntries(options.map((option) => [option.name, option.input.value])),
    conditions.filter((c) => c.input.checked).map((c) => c.name));
  return { parts: [...(method ? [] : [h("label", { for: "identify-method" }, "Method"), chosen]), place], read };
}

/** The button that asks for the options and begins. `begun` is called when it has begun. */
export function identifyButton(name, method, begun) {
  const click = async () => {
    const { parts, read } = fieldsFor(name, method);
    const sure = await ask({ title: "Identify this run again", fields: parts, yes: "Identify", no: "Close",
      lines: [`The last complete run of ${name}, in abbe-web: the running daemon and its model stay as they are.`] });
    if (sure === null) return;
    try {
      await post("api/identify", read());
      message("");
      await begun();
    } catch (error) {
      message(error.message);
    }
  };
  return h("button", { type: "button", "aria-label": `Identify ${name} again`, onclick: click }, "Identify again");
}

function resultParts({ result }) {
  return [h("p", {}, result.figures),
    result.simulated ? h("p", { class: "warn" }, "Made on simulated devices: it describes no real machine.") : null,
    ...(result.reasons.length ? [h("h3", {}, "Reasons against the model"), list(result.reasons)] : []),
    ...(result.notes.length ? [h("h3", {}, "To know about this model"), list(result.notes)] : []),
  ].filter((part) => part !== null);
}

/** Follows the identification of abbe-web in `place`, if `wanted` its status. Returns {follow, end}: `follow`
 * looks at once, `end` ends the view. */
export function identificationView(place, wanted = () => true) {
  const line = h("p", { role: "status", id: "identification" }), details = h("div"), tools = h("p", { class: "tools" });
  const title = h("h2", {}), bar = h("progress", { max: 1, value: 0, "aria-label": "progress of the identification" });
  let timer = 0, ended = false, shownTools = "";

  const act = (path, body, done) => async () => {
    try {
      await post(path, body);
      message(done);
    } catch (error) {
      message(error.message);
    }
    await follow().catch((error) => message(error.message));
  };
  const toolsOf = (now) => {
    if (now.state === "running")
      return mayIdentify() ? [h("button", { type: "button", onclick: act("api/cancelidentification", {}, "The identification ends.") },
        "Cancel the identification")] : [];
    if (now.state !== "done") return [];
    const { id, added, accepted } = now.result;
    const save = h("a", { href: "identified/model.json", download: "model.json" }, "Save model.json");
    if (added) return [h("a", { href: `#model/${id}` }, "Show the model"), h("a", { href: "#history" }, "Activate it in History"), save];
    const add = h("button", { type: "button", class: "strong", onclick: act("api/addidentified", { id },
      `${id} is in the store, ${accepted ? "accepted" : "refused"}. It is not active.`) }, "Add to the store");
    return mayIdentify() ? [add, save] : [save];
  };
  const draw = (now) => {
    if (now.state === "none" || !wanted(now)) return place.replaceChildren();
    title.textContent = `Identification of ${now.name} again`;
    const words = identificationInWords(now);
    if (line.textContent !== words) line.textContent = words;
    line.className = now.state === "failed" || (now.state === "done" && !now.result.accepted) ? "bad"
      : now.state === "done" ? "good" : "";
    bar.hidden = now.state !== "running";
    bar.value = now.progress ?? 0;
    const key = JSON.stringify([now.state, now.result, now.options, state.me.role]);
    if (key !== shownTools) {  // else a button would lose the focus
      shownTools = key;
      tools.replaceChildren(...toolsOf(now));
      details.replaceChildren(h("p", { class: "weak" }, `Options: ${now.options.join("; ") || "as recorded"}; begun by ${now.user}`),
        ...(now.state === "done" ? resultParts(now) : []));
    }
    if (!title.isConnected) place.replaceChildren(title, line, bar, tools, details);
  };
  const follow = async () => {
    clearTimeout(timer);
    const now = await get("api/identify");
    if (ended) return;
    draw(now);
    if (now.state === "running") lookAgain();
  };
  // Also after an answer that was lost: else the view would stay at "running".
  const lookAgain = () => {
    timer = setTimeout(() => follow().catch(() => { if (!ended) lookAgain(); }), kPoll_ms);
  };
  return { follow, end: () => { ended = true; clearTimeout(timer); } };
}
