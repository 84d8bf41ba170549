// Which labels of a drawing are shown.

import assert from "node:assert/strict";
import { test } from "node:test";
import { loadAsset } from "./load_asset.mjs";

const { withoutOverlap } = await loadAsset("labels.js");

const label = (name, x, more = {}) => ({ name, x, y: 10, width: 20, height: 10, depth: 1, first: false, ...more });
const shown = (...labels) => withoutOverlap(labels).map(({ name }) => name);

test("labels that do not overlap are all shown", () => {
  assert.deepEqual(shown(label("1", 0), label("2", 20), label("3", 0, { y: 20 })).sort(), ["1", "2", "3"]);
});

test("of labels that overlap the nearest is shown", () => {
  assert.deepEqual(shown(label("far", 0, { depth: 3 }), label("near", 10, { depth: 2 })), ["near"]);
});

test("a label that comes first hides a nearer one", () => {
  assert.deepEqual(shown(label("near", 0), label("next", 10, { depth: 9, first: true })), ["next"]);
});

test("a hidden label hides no other one", () => {
  assert.deepEqual(shown(label("a", 0), label("b", 15, { depth: 2 }), label("c", 30, { depth: 3 })), ["a", "c"]);
});
