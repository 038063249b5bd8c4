// Searches, labels and tables of the sessions page.
import assert from "node:assert/strict";
import test from "node:test";
import { csv } from "../../src/parts/save.ts";
import { NO_FILTERS, NONE, sessionsPath } from "../../src/sessions/query.ts";
import { answerOf, labelsOf, labelWords, truthName } from "../../src/sessions/words.ts";

test("filters become the parameters of the request, empty ones none", () => {
  assert.equal(sessionsPath(NO_FILTERS, 50), "/v1/sessions?order=newest&limit=50");
  const filters = { ...NO_FILTERS, object: "mug", labels: "site=oslo , shift", withTruth: "true", robot: " arm-3 " };
  const query = new URL(sessionsPath(filters), "http://x").searchParams;
  assert.deepEqual(Object.fromEntries(query), { order: "newest", robot: "arm-3*", object: "mug", labels: "site:oslo,shift", with_truth: "true" });
  const none = new URL(sessionsPath({ ...NO_FILTERS, object: NONE }), "http://x").searchParams;
  assert.deepEqual([none.get("none_of_these"), none.get("object")], ["true", null]);
  const since = new URL(sessionsPath({ ...NO_FILTERS, since: "2026-03-01T08:00" }), "http://x").searchParams.get("since");
  assert.equal(Date.parse(since), new Date("2026-03-01T08:00").getTime());
});

test("labels are read as they are written", () => {
  assert.deepEqual(labelsOf("site=oslo, shift = night,flag"), { site: "oslo", shift: "night", flag: "" });
  assert.deepEqual(labelsOf(""), {});
  assert.equal(labelsOf("site=oslo,=x"), undefined);
  assert.equal(labelWords({ site: "oslo", shift: "night" }), "site=oslo, shift=night");
});

test("a session is what its newest belief says, or none of these", () => {
  const session = (best, unknown) => ({ latest: { best, unknown } });
  assert.deepEqual(answerOf(session({ name: "mug", probability: 0.6 }, 0.4)), { name: "mug", probability: 0.6 });
  assert.deepEqual(answerOf(session({ name: "mug", probability: 0.3 }, 0.7)), { name: "none of these", probability: 0.7 });
  assert.equal(answerOf({ latest: null }), undefined);
  assert.deepEqual([truthName({ truth: { name: null } }), truthName({})], ["none of these", undefined]);
});

test("a table quotes what it must and holds no formula", () => {
  assert.equal(csv([["a", 1, null], ["b,c", -2.5, 'say "so"']]), 'a,1,\n"b,c",-2.5,"say ""so"""\n');
  assert.equal(csv([["=1+1", "-cmd", "@x", "two\nlines"]]), "'=1+1,'-cmd,'@x,\"two\nlines\"\n");
});
