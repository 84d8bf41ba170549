// What a person can choose when a recorded run is identified again. Names, words and units are those of
// `abbe identify METHOD`. Nothing here asks the server or draws.

export const methods = [["otf", "on the fly with a laser tracker"], ["evemu", "ball array"], ["mfb", "Multi-Feature Bar"]];

const kConfiguration = { name: "configuration", label: "Configuration",
  choices: [["", "as recorded"], ["present", "as it is now (limits of the gate, nodes, noise)"]] };
const choice = (name, label, values) => ({ name, label, choices: [["", "as configured"], ...values.map((v) => [v, v])] });

const kOptions = {
  otf: [kConfiguration,
    choice("tables", "Tables between their nodes", ["linear", "cubic", "not-a-knot-cubic"]),
    choice("backlash", "Backlash", ["none", "per-table", "forward-backward"]),
    { name: "smoothness_um", label: "Smoothness, um: none, one number, or X,Y,Z (empty: as configured)", text: true }],
  evemu: [kConfiguration,
    choice("estimator", "Estimator", ["bayes-pose", "ols", "ridge", "lasso", "mcp", "scad"]),
    choice("order", "Order of the polynomials", ["1", "2", "3", "4", "5"])],
  mfb: [kConfiguration, choice("estimator", "Estimator", ["simultaneous", "sequential"])],
};

/** The options of a method: {name, label}, with `choices` [[value, words], ...] or `text`. */
export const optionsOf = (method) => kOptions[method] ?? [];

const kOfEveryMethod = [["smaller-volume", "a smaller volume than that of the active model"],
  ["scale-change", "another scale than that of the active model"]];
const kConditions = {
  otf: [["path-orientation", "a path that may be rotated by 180 degrees"]],
  evemu: [["evemu-shape-only", "a rotation about Ball1 that is not known"]],
  mfb: [["bar-temperature", "a bar more than 12 K from 20 C"],
    ["bar-temperature-change", "a bar warmer or colder at a position than at the next ones"]],
};

/** Conditions that the gate refuses unless a person accepts them: [[name, words], ...]. */
export const conditionsOf = (method) => [...(kConditions[method] ?? []), ...kOfEveryMethod];

/** Why the text is no smoothness of `abbe identify otf`; empty: it is one, or empty. */
export function smoothnessFault(text) {
  const given = text.trim();
  if (given === "" || given === "none") return "";
  const numbers = given.split(",").map((part) => (part.trim() === "" ? NaN : Number(part)));
  const fits = [1, 3].includes(numbers.length) && numbers.some((um) => um > 0) &&
    numbers.every((um) => um === 0 || (um >= 0.01 && um <= 1000));
  return fits ? "" : "Smoothness: none, or one number or X,Y,Z in um, each 0.01 to 1000, or 0 for no prior";
}

/** The request for the server. `values`: by the name of an option; what is empty is not sent. */
export function requestOf(name, method, values, accept) {
  const request = { name, method };
  for (const option of optionsOf(method)) {
    const value = (values[option.name] ?? "").trim();
    if (value !== "") request[option.name] = option.name === "order" ? Number(value) : value;
  }
  if (accept.length) request.accept = accept;
  return request;
}

/** A recording that is being written ends in ".part", which it loses. */
const closedName = (name) => (name ?? "").replace(/\.part$/, "");
export const isSameRecording = (a, b) => closedName(a) !== "" && closedName(a) === closedName(b);

/** What the last identification is, and how it ended, in one sentence. */
export function identificationInWords(now) {
  if (now.state === "running") return now.step ? `running: ${now.step}` : "running";
  if (now.state === "failed") return `no model: ${now.error}`;
  if (now.state !== "done") return "";
  const { id, accepted, added } = now.result;
  return `Model ${id}: ${accepted ? "accepted by the gate" : "refused by the gate"}` +
    (added ? `; in the store as ${accepted ? "accepted" : "refused"}, not active` : "; not in the store yet");
}
