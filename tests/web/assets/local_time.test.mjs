// Times for people, and the ticks of time axes, in a zone whose clocks change.

import assert from "node:assert/strict";
import { test } from "node:test";
import { loadAsset } from "./load_asset.mjs";

process.env.TZ = "Europe/Berlin";
const { localTime, timeTicks } = await loadAsset("local_time.js");

const at = (text) => Date.parse(text);
const labels = (from, to, most) => timeTicks(at(from), at(to), most).map(({ label }) => label);

test("local time has its zone, and UTC beside it", () => {
  assert.equal(localTime(at("2026-11-26T18:30:05.9Z")), "2026-11-26 19:30:05 +0100 (2026-11-26T18:30:05Z)");
  assert.equal(localTime(at("2026-07-26T18:30:05Z")), "2026-07-26 20:30:05 +0200 (2026-07-26T18:30:05Z)");
  assert.equal(localTime(NaN), "");
});

test("ticks are at round local times", () => {
  assert.deepEqual(labels("2026-11-26T18:28:20Z", "2026-11-26T18:33:20Z", 8), ["19:29", "19:30", "19:31", "19:32", "19:33"]);
  assert.deepEqual(labels("2026-11-26T18:30:05Z", "2026-11-27T02:30:05Z", 6), ["20:00", "22:00", "00:00", "02:00"]);
  assert.deepEqual(labels("2026-11-26T18:30:00Z", "2026-11-26T18:30:03Z", 4), ["19:30:00", "19:30:01", "19:30:02", "19:30:03"]);
});

test("days begin at local midnight, months with their first day", () => {
  assert.deepEqual(labels("2026-11-24T12:00:00Z", "2026-11-28T12:00:00Z", 5), ["2026-11-25", "2026-11-26", "2026-11-27", "2026-11-28"]);
  assert.equal(timeTicks(at("2026-11-24T12:00:00Z"), at("2026-11-25T12:00:00Z"), 2)[0].value, at("2026-11-24T23:00:00Z"));
  assert.deepEqual(labels("2025-11-15T00:00:00Z", "2026-12-15T00:00:00Z", 6), ["2026-01", "2026-04", "2026-07", "2026-10"]);
});

test("where the clocks change, labels stay at round hours", () => {
  // 2026-10-25, 01:00 UTC: 03:00 becomes 02:00.
  assert.deepEqual(labels("2026-10-24T22:00:00Z", "2026-10-25T06:00:00Z", 6), ["00:00", "02:00", "04:00", "06:00"]);
});

test("there are never more ticks than are wanted, and none without a time", () => {
  for (const hours of [0.001, 0.1, 1, 5, 8, 24, 100, 1000, 9000, 90000])
    for (const most of [2, 3, 7, 20]) {
      const ticks = timeTicks(at("2026-03-01T10:17:03Z"), at("2026-03-01T10:17:03Z") + hours * 3600e3, most);
      assert.ok(ticks.length <= most, `${hours} h, ${most}: ${ticks.length}`);
    }
  assert.deepEqual(timeTicks(5, 5, 4), []);
  assert.deepEqual(timeTicks(NaN, 5, 4), []);
});
