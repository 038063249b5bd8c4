// The fleet's past: traces from the list and from live events become one.
import assert from "node:assert/strict";
import { test } from "node:test";
import { joined } from "../../src/fleet/watch.ts";

const point = (revision, entropyBits = 1) => ({ revision, nReadings: revision, entropyBits, best: "mug", probability: 0.5, unknown: 0 });

test("two traces become one, in the order of revisions", () => {
  const trace = joined([point(1), point(4)], [point(3), point(2)]);
  assert.deepEqual(trace.map((one) => one.revision), [1, 2, 3, 4]);
});

test("of two points of a revision the newer one counts", () => {
  assert.deepEqual(joined([point(1, 2)], [point(1, 0.5)]), [point(1, 0.5)]);
});

test("a trace keeps the newest 200 points", () => {
  const long = Array.from({ length: 250 }, (_, i) => point(i + 1));
  const trace = joined(long, [point(251)]);
  assert.equal(trace.length, 200);
  assert.equal(trace[0].revision, 52);
  assert.equal(trace.at(-1).revision, 251);
});
