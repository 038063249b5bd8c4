// Titles state what is believed, and of whom.
import assert from "node:assert/strict";
import { test } from "node:test";
import { answerOf, titleOf } from "../../src/belief.ts";

const best = (name, probability) => ({ name, probability });
const title = (objects, unknown, nReadings = 3) => titleOf(answerOf({ objects, unknown }, nReadings), "arm-3");

test("a title states the likeliest object, its probability and the robot", () => {
  assert.equal(title([best("hammer", 0.9999), best("mug", 0.0001)], 0), "hammer, >99.9 % — arm-3");
});

test("the likeliest counts, whatever the order", () => {
  assert.equal(title([best("mug", 0.2), best("gear", 0.7)], 0.1), "gear, 70.0 % — arm-3");
});

test("none of these leads only when it is likelier than every object", () => {
  assert.equal(title([best("mug", 0.2)], 0.8), "none of these, 80.0 % — arm-3");
  assert.equal(title([best("mug", 0.5)], 0.5), "mug, 50.0 % — arm-3");
  assert.equal(answerOf({ objects: [best("mug", 0.2)], unknown: 0.8 }, 1).isUnknown, true);
  assert.equal(answerOf({ objects: [best("mug", 0.2)] }, 1).isUnknown, false);
});

test("before the first reading nothing is believed", () => {
  assert.equal(title([best("mug", 0.9)], 0.1, 0), "nothing felt yet — arm-3");
  assert.equal(titleOf(answerOf(undefined, 5), "arm-3"), "nothing felt yet — arm-3");
});
