// Poses and tactile images as numbers.
import assert from "node:assert/strict";
import { test } from "node:test";
import { centreOfPressure, rotate, transform, upright } from "../../src/scene/vectors.ts";

const HALF = Math.SQRT1_2;
/** A quarter turn about z: x becomes y. */
const QUARTER_Z = [0, 0, HALF, HALF];

function near(found, expected) {
  for (const [i, part] of found.entries()) assert.ok(Math.abs(part - expected[i]) < 1e-12, `${found} is not ${expected}`);
}

test("a quarter turn about z takes x to y and y to -x", () => {
  near(rotate(QUARTER_Z, [1, 0, 0]), [0, 1, 0]);
  near(rotate(QUARTER_Z, [0, 1, 0]), [-1, 0, 0]);
  near(rotate(QUARTER_Z, [0, 0, 1]), [0, 0, 1]);
});

test("a turn about x takes y to z", () => {
  near(rotate([HALF, 0, 0, HALF], [0, 2, 0]), [0, 0, 2]);
});

test("a third of a turn about the diagonal takes x to y to z to x", () => {
  const third = [0.5, 0.5, 0.5, 0.5];
  near(rotate(third, [1, 2, 3]), [3, 1, 2]);
});

test("a pose rotates first, then moves", () => {
  near(transform({ position: [1, 2, 3], orientation: QUARTER_Z }, [1, 0, 0]), [1, 3, 3]);
});

const sensor = (order) => ({
  description: { grid: { rows: 2, cols: 3, pitch: 0.002 }, image_order: order },
});
const SENT = [1, 2, 3, 4, 5, 6];

test("an image that is sent upright stays as it is", () => {
  assert.deepEqual(upright(sensor(undefined), SENT), { rows: 2, cols: 3, values: SENT });
});

test("reversed rows, reversed columns and transposed images are turned", () => {
  assert.deepEqual(upright(sensor({ rows_reversed: true }), SENT).values, [4, 5, 6, 1, 2, 3]);
  assert.deepEqual(upright(sensor({ cols_reversed: true }), SENT).values, [3, 2, 1, 6, 5, 4]);
  // Sent column by column: 1 2 | 3 4 | 5 6.
  assert.deepEqual(upright(sensor({ transposed: true }), SENT).values, [1, 3, 5, 2, 4, 6]);
});

test("a taxel that was not sent is missing, not zero", () => {
  assert.deepEqual(upright(sensor(undefined), [1, null]).values, [1, null, null, null, null, null]);
});

test("listed taxels are seen at their places", () => {
  const taxels = [[-0.002, 0], [0.002, 0]].map(([x, y]) => ({ position: { x, y } }));
  const listed = { layout: { drawing: "at_contact" }, description: { grid: { rows: 1, cols: 2, pitch: 0.002 }, taxels } };
  // Three places at −2, 0 and 2 mm; the middle one is a whole pitch from both taxels.
  assert.deepEqual(upright(listed, [7, 9]), { rows: 1, cols: 3, values: [7, null, 9] });
});

test("listed taxels lie in rows along +y", () => {
  const taxels = [[0, 0.002], [0, -0.002]].map(([x, y]) => ({ position: { x, y } }));
  const listed = { layout: { drawing: "at_contact" }, description: { grid: { rows: 2, cols: 1, pitch: 0.002 }, taxels } };
  assert.deepEqual(upright(listed, [7, 9]), { rows: 3, cols: 1, values: [9, null, 7] });
});

test("the centre of pressure weighs what is in contact", () => {
  const image = { rows: 2, cols: 3, values: [0, 0, 3000, 0, 0, 9000] };
  // Column 2 is one pitch right of the middle; rows lie half a pitch below and above it, 1 to 3.
  near(centreOfPressure(sensor(), image), [0.002, 0.0005, 0]);
});

test("below two kilopascal nothing is in contact", () => {
  assert.equal(centreOfPressure(sensor(), { rows: 2, cols: 3, values: [1999, 0, null, 0, 0, 0] }), null);
  near(centreOfPressure(sensor(), { rows: 2, cols: 3, values: [1999, 2000, null, 0, 0, 0] }), [0, -0.001, 0]);
});
