// The configuration as abbe understood it.

import { facts, h, list } from "./dom.js";
import { get } from "./server.js";

export async function show(place) {
  const { file, sha256, understood, warnings, faults } = await get("api/configuration");
  place.append(h("h2", {}, `Configuration ${file}`));
  if (sha256) place.append(h("p", {}, "SHA-256 of the file: ", h("code", {}, sha256)));
  if (faults) {
    place.append(h("p", { class: "bad" }, "The file has faults:"), list(faults));
    return;
  }
  // "axis X        -300 to 300 mm": the name of a fact has 13 characters.
  place.append(facts("configuration", understood.map((line) => [line.slice(0, 13).trim(), line.slice(13).trim()])));
  if (warnings.length)
    place.append(h("h2", {}, "Warnings"), list(warnings.map((w) => h("span", { class: "warn" }, w))));
}
