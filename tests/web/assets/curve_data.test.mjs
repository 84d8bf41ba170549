// Curves of the page: what an answer adds, gaps, and fewer points than pixels.

import assert from "node:assert/strict";
import { test } from "node:test";
import { loadAsset } from "./load_asset.mjs";

const { coarser, isolated, merged, next, summary, timesOf, valueText, windowOf } = await loadAsset("curve_data.js");

/** An answer of the server; `curves`: means by name, `gaps`: by name. */
const answer = (first, length, curves, { buckets = 5, gaps = {}, window = "5min" } = {}) => ({ window, step_s: 1, buckets, first, length,
  curves: Object.entries(curves).map(([name, mean]) => ({ group: "axes", name, unit: "mm", mean, gaps: gaps[name] ?? [],
    min: mean.map((m) => m && m - 1), max: mean.map((m) => m && m + 1) })) });
const means = (data) => Object.fromEntries(data.curves.map((c) => [c.name, c.mean]));

test("the newest bucket, which was not complete, is replaced", () => {
  const data = merged(merged(null, answer(10, 3, { X: [1, 2, 3] })), answer(12, 2, { X: [4, 5] }));
  assert.deepEqual([data.first, data.length, means(data)], [10, 4, { X: [1, 2, 4, 5] }]);
  assert.equal(next(data), 13);
  assert.equal(next(null), 0);
});

test("not more is kept than the window has", () => {
  const data = merged(merged(null, answer(10, 5, { X: [1, 2, 3, 4, 5] })), answer(14, 3, { X: [6, 7, 8] }));
  assert.deepEqual([data.first, means(data)], [12, { X: [3, 4, 6, 7, 8] }]);
});

test("a curve that an answer does not have is missing there, and a new one before", () => {
  const data = merged(merged(null, answer(10, 2, { X: [1, 2] })), answer(11, 3, { Y: [7, 8, 9] }));
  assert.deepEqual(means(data), { X: [1, null, null, null], Y: [null, 7, 8, 9] });
});

test("an answer without values moves all on, until nothing is left", () => {
  let data = merged(null, answer(10, 2, { X: [1, 2] }));
  data = merged(data, answer(11, 4, {}));
  assert.deepEqual(means(data), { X: [1, null, null, null, null] });
  assert.deepEqual(means(merged(data, answer(14, 5, {}))), {});
});

test("an answer that does not follow, or is of another window, replaces all", () => {
  const known = merged(null, answer(10, 2, { X: [1, 2] }));
  assert.deepEqual(means(merged(known, answer(20, 2, { X: [8, 9] }))), { X: [8, 9] });
  assert.deepEqual(means(merged(known, answer(3, 2, { X: [8, 9] }))), { X: [8, 9] });
  assert.deepEqual(means(merged(known, answer(11, 2, { X: [8, 9] }, { window: "1h" }))), { X: [8, 9] });
});

test("gaps stay with their buckets", () => {
  const data = merged(merged(null, answer(10, 3, { X: [1, null, 3] }, { gaps: { X: [12] } })), answer(12, 2, { X: [3, 4] }, { gaps: { X: [12] } }));
  assert.deepEqual(data.curves[0].gap, [false, false, true, false]);
});

test("with fewer pixels the band has the smallest and largest value, and a gap stays", () => {
  const data = merged(null, answer(9, 5, { X: [1, 2, 6, null, 10] }, { gaps: { X: [13] } }));
  const wide = coarser(data, 2);  // buckets 8-9, 10-11, 12-13
  assert.deepEqual([wide.first, wide.length, wide.step_s], [4, 3, 2]);
  const [curve] = wide.curves;
  assert.deepEqual([curve.min, curve.max, curve.mean, curve.gap], [[0, 1, 9], [2, 7, 11], [1, 4, 10], [false, false, true]]);
  assert.equal(coarser(data, 1), data);
  assert.deepEqual(timesOf(wide, 0), [9000, 11000, 13000]);
});

test("a value between two gaps is a dot", () => {
  const gap = [false, false, true, true, false];
  assert.deepEqual(isolated({ mean: [1, 2, 3, 4, 5], gap }), [false, false, true, false, false]);
  assert.deepEqual(isolated({ mean: [null, 2, null], gap: [false, false, false] }), [false, true, false]);
});

test("an old value is not shown as the present one", () => {
  const curve = { mean: [1, 2, null, null], min: [0, 1, null, null], max: [2, 3, null, null] };
  assert.deepEqual(summary(curve, 2), { last: 2, min: 0, max: 3 });
  assert.equal(summary(curve, 1).last, null);
  assert.deepEqual(summary({ mean: [null], min: [null], max: [null] }, 1), { last: null, min: null, max: null });
});

test("values have at most six digits", () => {
  assert.equal(valueText(1234.56789, "mm"), "1234.57");
  assert.equal(valueText(-0.123456, "mm"), "-0.1235");
  assert.equal(valueText(20.123, "\u00b0C"), "20.12");
  assert.equal(valueText(1013.256, "hPa"), "1013.26");
  assert.equal(valueText(1234567.8, "us"), "1234568");
  assert.equal(valueText(null, "mm"), "-");
});

test("the address names the window", () => {
  assert.equal(windowOf("#curves/8h").length_s, 28800);
  assert.equal(windowOf("#curves/2h").name, "5min");
  assert.equal(windowOf("#curves").name, "5min");
});
