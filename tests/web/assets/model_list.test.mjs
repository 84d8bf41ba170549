// Search, filter and pages of the History view.

import assert from "node:assert/strict";
import { test } from "node:test";
import { loadAsset } from "./load_asset.mjs";

process.env.TZ = "Europe/Berlin";
const { filterOf, hashOf, kPerPage, matching, noFilter, pageOf } = await loadAsset("model_list.js");

const model = (id, more = {}) => ({ id, active: false, accepted: true, judged: true, reasons: [], fault: "",
  method: "otf", machine: "mill 7", added: "2026-11-26T18:30:05Z", ...more });
const ids = (models, filter) => matching(models, { ...noFilter(), ...filter }).map((m) => m.id);

test("a filter that is written into the address is read again", () => {
  const filter = { search: "mill & 50 % #1/2", method: "otf", verdict: "not judged", from: "2026-11-01", to: "2026-11-30", page: 3 };
  assert.deepEqual(filterOf(hashOf(filter)), filter);
});

test("without a choice the address has the name of the view alone", () => {
  assert.equal(hashOf(noFilter()), "#history");
  assert.deepEqual(filterOf("#history"), noFilter());
});

test("what the address has of another form is not used", () => {
  const hash = "#history/verdict=good&from=yesterday&to=2026-99-99&page=-1&other=1";
  assert.deepEqual(filterOf(hash), noFilter());
  assert.equal(filterOf("#history/page=1e9").page, 1e9);
  assert.equal(filterOf("#history/page=0.5").page, 1);
});

test("each word of the search must be found, in any letters", () => {
  const models = [model("aa11"), model("bb22", { reasons: ["Held-out rms 9 um"] }), model("cc33", { machine: "lathe" })];
  assert.deepEqual(ids(models, { search: "  held-OUT 9 " }), ["bb22"]);
  assert.deepEqual(ids(models, { search: "mill" }), ["aa11", "bb22"]);
  assert.deepEqual(ids(models, { search: "mill lathe" }), []);
});

test("a verdict selects its models, and active ones are accepted as well", () => {
  const models = [model("active", { active: true }), model("accepted"), model("refused", { accepted: false }),
    model("open", { accepted: false, judged: false }), model("damaged", { accepted: false, fault: "cut off" })];
  assert.deepEqual(ids(models, { verdict: "active" }), ["active"]);
  assert.deepEqual(ids(models, { verdict: "accepted" }), ["active", "accepted"]);
  assert.deepEqual(ids(models, { verdict: "refused" }), ["refused"]);
  assert.deepEqual(ids(models, { verdict: "not judged" }), ["open"]);
  assert.deepEqual(ids(models, { verdict: "damaged" }), ["damaged"]);
});

test("days are local, and both are included", () => {
  // Midnight in Berlin is 23:00 UTC.
  const models = [model("before", { added: "2026-11-25T22:59:59Z" }), model("first", { added: "2026-11-25T23:00:00Z" }),
    model("last", { added: "2026-11-26T22:59:59Z" }), model("after", { added: "2026-11-26T23:00:00Z" })];
  assert.deepEqual(ids(models, { from: "2026-11-26", to: "2026-11-26" }), ["first", "last"]);
});

test("500 models are 25 pages, and each is on one of them", () => {
  const models = Array.from({ length: 500 }, (_, i) => model(String(i)));
  const pages = Array.from({ length: 25 }, (_, i) => pageOf(models, i + 1));
  assert.ok(pages.every((p) => p.pages === 25 && p.models.length === kPerPage));
  assert.deepEqual(pages.flatMap((p) => p.models), models);
});

test("a page behind the end is the last one", () => {
  assert.deepEqual(pageOf([model("a")], 9), { pages: 1, page: 1, models: [model("a")] });
  assert.deepEqual(pageOf([], 1), { pages: 1, page: 1, models: [] });
});
