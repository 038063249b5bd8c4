// The heat map of what a touch tells: its scale, its colours, and values carried to a surface.
import assert from "node:assert/strict";
import { test } from "node:test";
import { medianBits, mostTelling, points, scaleOf, valued } from "../../src/objects/interest.ts";
import { carried } from "../../src/scene/heat.ts";

const place = (x, bits, normal = [0, 0, 1]) => ({ position: [x, 0, 0], normal, bits });
const mapOf = (...places) => ({ id: "", name: "mug", bits_max: 2, places, rivals: [] });

test("colours span the least to the most that a place tells", () => {
  assert.deepEqual(scaleOf([place(0, 0.5), place(1, 1.5)]), { low: 0.5, high: 1.5 });
  assert.deepEqual(valued(mapOf(place(0, 0.5), place(1, 1.5), place(2, 1))).map((one) => one.value), [0, 1, 0.5]);
});

test("places that tell the same have the same colour, not noise", () => {
  assert.deepEqual(scaleOf([place(0, 1.5), place(1, 1.5)]), { low: 1.25, high: 1.5 });
  assert.deepEqual(scaleOf([place(0, 0)]), { low: 0, high: 0.25 });
  const colors = points(mapOf(place(0, 1.5), place(1, 1.49))).map((point) => point.color);
  assert.equal(colors[0], "#f6e682", "the bright end of the scale");
  assert.match(colors[1], /^#e[0-9a-f]e/, "nearly as bright");
});

test("the places that tell most come first, and the median is in the middle", () => {
  const map = mapOf(place(0, 0.1), place(1, 0.9), place(2, 0.4));
  assert.deepEqual(mostTelling(map, 2).map((one) => one.bits), [0.9, 0.4]);
  assert.equal(medianBits(map), 0.4);
});

test("a point takes the values of places near it, the nearer the more", () => {
  const places = [{ position: [0, 0, 0], normal: [0, 0, 1], value: 0 }, { position: [2, 0, 0], normal: [0, 0, 1], value: 1 }];
  const up = [0, 0, 1];
  const [middle, near, far] = carried([1, 0, 0, 0.5, 0, 0, 50, 0, 0], [...up, ...up, ...up], places, 1);
  assert.ok(Math.abs(middle - 0.5) < 1e-6, `${middle}`);
  // exp(−0.125) to exp(−1.125): 1/(1 + e).
  assert.ok(Math.abs(near - 1 / (1 + Math.E)) < 1e-6, `${near}`);
  assert.ok(Number.isNaN(far));
});

test("a value does not pass through a thin wall", () => {
  const places = [{ position: [0, 0, 0], normal: [0, 0, 1], value: 1 }];
  assert.ok(Number.isNaN(carried([0, 0, -0.1], [0, 0, -1], places, 1)[0]));
});
