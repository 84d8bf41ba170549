// What can be chosen when a run is identified again, and the request that follows from it.

import assert from "node:assert/strict";
import { test } from "node:test";
import { loadAsset } from "./load_asset.mjs";

const { conditionsOf, identificationInWords, isSameRecording, methods, optionsOf, requestOf, smoothnessFault } =
  await loadAsset("identify_options.js");

test("every method has options and conditions, each with one name", () => {
  for (const [method] of methods) {
    const names = optionsOf(method).map((option) => option.name);
    assert.ok(names.includes("configuration"), method);
    assert.equal(new Set(names).size, names.length);
    assert.ok(conditionsOf(method).length > 2);
  }
  assert.deepEqual(optionsOf("magic"), []);
});

test("what is not chosen is not sent", () => {
  assert.deepEqual(requestOf("run.mcap", "otf", { tables: "", smoothness_um: "  ", backlash: "none" }, []),
    { name: "run.mcap", method: "otf", backlash: "none" });
  assert.deepEqual(requestOf("run.mcap", "evemu", { order: "3", tables: "cubic" }, ["evemu-shape-only"]),
    { name: "run.mcap", method: "evemu", order: 3, accept: ["evemu-shape-only"] });
});

test("a smoothness is none, one number or three, in um", () => {
  for (const text of ["", " none ", "3", "0.01", "3,0,1000", " 1 , 2 , 3 "]) assert.equal(smoothnessFault(text), "", text);
  for (const text of ["much", "0", "0.001", "1001", "-1", "1,2", "1,,3", "0,0,0", "3 um", "Infinity"])
    assert.match(smoothnessFault(text), /0\.01 to 1000/, text);
});

test("a recording is the same before and after it is closed", () => {
  assert.ok(isSameRecording("run.mcap.part", "run.mcap"));
  assert.ok(!isSameRecording("run.mcap", "run2.mcap"));
  assert.ok(!isSameRecording("", ""));
  assert.ok(!isSameRecording(undefined, "run.mcap"));
});

test("how it ended is one sentence", () => {
  const done = (accepted, added) => identificationInWords({ state: "done", result: { id: "ab12", accepted, added } });
  assert.equal(identificationInWords({ state: "none" }), "");
  assert.equal(identificationInWords({ state: "running", step: "replaying" }), "running: replaying");
  assert.equal(identificationInWords({ state: "failed", error: "cancelled by anna" }), "no model: cancelled by anna");
  assert.equal(done(true, false), "Model ab12: accepted by the gate; not in the store yet");
  assert.equal(done(false, true), "Model ab12: refused by the gate; in the store as refused, not active");
});
