// The 3-D view's numbers: framing, picking, uncertainty, coverage and fading.
import assert from "node:assert/strict";
import { test } from "node:test";
import { apartness, FAR, surfaceArea, touchedShare } from "../../src/scene/coverage.ts";
import { directionSpread, positionSpread } from "../../src/scene/spread.ts";
import { ballAround, dot, markAt, outline, roundLength, standpoint } from "../../src/scene/view.ts";
import { contentOf, strengthOf } from "../../src/session/content.ts";

function near(found, expected, within = 1e-9) {
  for (const [i, part] of [...found].entries()) assert.ok(Math.abs(part - expected[i]) <= within, `${found} is not ${expected}`);
}

const DIRECTIONS = { right: [1, 0, 0], up: [0, 0, 1], back: [0, -1, 0] };
const OPENING = { across: 0.8, upright: 0.5 };

/** Where a point is seen: −1 to 1 across and upright, from edge to edge. */
function seen(point, { target, distance }) {
  const from = point.map((part, i) => part - target[i]);
  const depth = distance - dot(from, DIRECTIONS.back);
  return [dot(from, DIRECTIONS.right) / depth / OPENING.across, dot(from, DIRECTIONS.up) / depth / OPENING.upright];
}

const BOX = [0, 1, 2, 3, 4, 5, 6, 7].map((i) => [i & 1 ? 3 : 1, i & 2 ? 0.5 : -0.5, i & 4 ? 8 : 4]);

test("all points are in view, and the outermost at the edge", () => {
  const at = BOX.map((point) => seen(point, standpoint(BOX, DIRECTIONS, OPENING)));
  const most = Math.max(...at.flat().map(Math.abs));
  assert.ok(Math.abs(most - 1) < 1e-9, `the outermost is at ${most}`);
});

test("the points are in the middle of the frame", () => {
  const at = BOX.map((point) => seen(point, standpoint(BOX, DIRECTIONS, OPENING)));
  for (const i of [0, 1]) {
    const parts = at.map((one) => one[i]);
    assert.ok(Math.abs(Math.min(...parts) + Math.max(...parts)) < 1e-3, `off the middle: ${parts}`);
  }
});

test("a flat thing across the view is as far as its width asks", () => {
  // Half a width of 2 at a tangent of 0.8 is 2.5 away; upright 0.5 at 0.5 is only 1.
  const { target, distance } = standpoint([[-2, 5, 0], [2, 5, 0], [0, 5, 0.5], [0, 5, -0.5]], DIRECTIONS, OPENING);
  near(target, [0, 5, 0]);
  near([distance], [2.5]);
});

test("an outline holds every corner, and nothing from within", () => {
  const cloud = [...BOX, [2, 0, 6], [1.5, 0.2, 5]].flat();
  const found = outline(cloud).map(String).sort();
  assert.deepEqual(found, BOX.map(String).sort());
  assert.deepEqual(outline([]), []);
});

test("the ball about points goes through the corners of their box", () => {
  const { centre, radius } = ballAround(BOX);
  near(centre, [2, 0, 6]);
  near([radius], [Math.hypot(2, 1, 4) / 2]);
  assert.equal(ballAround([[1, 1, 1]]).radius, 0.01);
  assert.deepEqual(ballAround([]), { centre: [0, 0, 0], radius: 0.05 });
});

test("round lengths are 1, 2 and 5 times powers of ten", () => {
  const cases = [[0.9, 0.5], [1, 1], [1.99, 1], [2, 2], [4.9, 2], [5, 5], [9.99, 5], [10, 10], [73, 50], [0.05, 0.05]];
  for (const [most, length] of cases) near([roundLength(most)], [length]);
});

test("of the marks under the pointer the one in front is meant", () => {
  const marks = [{ id: 1, x: 10, y: 10, depth: 5 }, { id: 2, x: 13, y: 10, depth: 3 }, { id: 3, x: 40, y: 10, depth: 1 }];
  assert.equal(markAt(marks, { x: 10, y: 10 }, 9), 2);
  assert.equal(markAt(marks, { x: 10, y: 10 }, 2), 1);
  assert.equal(markAt(marks, { x: 10, y: 30 }, 9), undefined);
});

/** A covariance with these blocks; the rest is 0. */
function covariance(position, turn) {
  const all = new Array(36).fill(0);
  for (const i of [0, 1, 2]) for (const k of [0, 1, 2]) [all[i * 6 + k], all[(i + 3) * 6 + k + 3]] = [position[i][k], turn[i][k]];
  return all;
}
const NONE = [[0, 0, 0], [0, 0, 0], [0, 0, 0]];

test("the spread of a position has its largest direction first", () => {
  const { sigmas, directions } = positionSpread(covariance([[4, 0, 0], [0, 9, 0], [0, 0, 1]], NONE));
  near(sigmas, [3, 2, 1]);
  near(directions[0].map(Math.abs), [0, 1, 0]);
});

test("the spread of a position turns with its covariance", () => {
  // Variance 9 along (1, 1, 0), 1 along (1, −1, 0), 4 along z.
  const { sigmas, directions } = positionSpread(covariance([[5, 4, 0], [4, 5, 0], [0, 0, 4]], NONE));
  near(sigmas, [3, 2, 1]);
  near(directions[0].map((part) => Math.abs(part)), [Math.SQRT1_2, Math.SQRT1_2, 0]);
  assert.ok(directions[0][0] * directions[0][1] > 0, "x and y grow together");
});

test("a full covariance is the sum of its spreads", () => {
  const matrix = [[3, 1, 0.5], [1, 2, -0.4], [0.5, -0.4, 1]];
  const { sigmas, directions } = positionSpread(covariance(matrix, NONE));
  for (const i of [0, 1, 2]) {
    const row = [0, 1, 2].map((k) => sigmas.reduce((sum, sigma, n) => sum + sigma ** 2 * directions[n][i] * directions[n][k], 0));
    near(row, matrix[i]);
  }
});

test("a turn about x moves y and z, not x", () => {
  const turning = covariance(NONE, [[0.04, 0, 0], [0, 0, 0], [0, 0, 0]]);
  near(directionSpread(turning, [1, 0, 0]).sigmas, [0, 0, 0]);
  const y = directionSpread(turning, [0, 1, 0]);
  near(y.sigmas, [0.2, 0, 0]);
  near(y.directions[0].map(Math.abs), [0, 0, 1]);
});

const press = (x, normal = [0, 0, 1]) => ({ position: [x, 0, 0], normal, reach: 2 });
const UP = [0, 0, 1];

test("a point is as far as its nearest press, in reaches", () => {
  const points = [0, 0, 0, 1, 0, 0, 3, 0, 0, 9, 0, 0];
  near(apartness(points, [...UP, ...UP, ...UP, ...UP], [press(0), press(2.5)]), [0, 0.5, 0.25, FAR], 1e-6);
});

test("a press does not touch the other side of a thin wall", () => {
  near(apartness([0, 0, 0, 0, 0, -0.1], [0, 0, 1, 0, 0, -1], [press(0)]), [0, FAR]);
});

test("nothing is touched without a press", () => {
  assert.deepEqual([...apartness([0, 0, 0], UP, [])], [FAR]);
});

// Two triangles of areas 2 and 6.
const TRIANGLES = [0, 0, 0, 2, 0, 0, 0, 2, 0, 0, 0, 5, 4, 0, 5, 0, 3, 5];

test("the touched share is by area", () => {
  near([surfaceArea(TRIANGLES)], [8]);
  near([touchedShare(TRIANGLES, [0, 0.5, 1, 2, 2, 2])], [0.25]);
  near([touchedShare(TRIANGLES, [2, 2, 2, 0, 2, 2])], [0.25]);
  assert.equal(touchedShare([], []), 0);
});

test("the newest touches are plain, older ones ever fainter", () => {
  assert.equal(strengthOf(0), 1);
  assert.equal(strengthOf(7), 1);
  assert.ok(strengthOf(8) < 1 && strengthOf(8) > strengthOf(20));
  assert.equal(strengthOf(500), 0.2);
});

const sensor = { id: "pad", description: { grid: { rows: 6, cols: 8, pitch: 0.002 } } };
const contact = (number) => ({ number, sensor: "pad", retracted_by: null, contact: { position: [number, 0, 0], normal: [1, 0, 0], touched: number !== 1 } });
const pose = { object: "mug", name: "mug", weight: 1, pose: { position: [0, 0, 0], orientation: [0, 0, 0, 1] }, covariance: covariance(NONE, NONE) };
const LAYERS = { touches: true, faded: true, ghosts: true, uncertainty: false, untouched: false, truth: true };

function shown(layers, truth) {
  const readings = Array.from({ length: 20 }, (_, i) => contact(i));
  return contentOf({
    belief: { poses: [pose, { ...pose, weight: 0.3 }, { ...pose, weight: 0.01 }] }, truth, revision: 18, readings, tints: new Map(), next: [],
    sensors: new Map([["pad", sensor]]), shapes: new Map([["mug", { id: "mug" }]]), layers: { ...LAYERS, ...layers },
  });
}

test("touches up to the revision are drawn with the reach of their pad", () => {
  const { touches } = shown({});
  assert.deepEqual(touches.map((touch) => touch.id), Array.from({ length: 18 }, (_, i) => i));
  // Half of six taxels of 2 mm.
  near([touches[0].reach], [0.006]);
  assert.deepEqual([touches[0].contact, touches[1].contact], [true, false]);
  assert.ok(touches[0].strength < touches[17].strength);
});

test("hidden touches still count for what was touched", () => {
  const { touches, covering } = shown({ touches: false, untouched: true });
  assert.equal(touches.length, 0);
  assert.equal(covering.length, 18);
  assert.equal(shown({}).covering, undefined);
});

test("layers are drawn when they are chosen", () => {
  assert.ok(shown({ faded: false }).touches.every((touch) => touch.strength === 1));
  assert.equal(shown({}).bodies.length, 2, "a hypothesis of 1 % is no ghost");
  assert.equal(shown({ ghosts: false }).bodies.length, 1);
  assert.equal(shown({}).uncertain, undefined);
  assert.equal(shown({ uncertainty: true }).uncertain.covariance, pose.covariance);
});

test("the true object is drawn where it truly is, if both were told", () => {
  const there = { position: [0.1, 0, 0], orientation: [0, 0, 0, 1] };
  const drawn = (truth, layers = {}) => shown(layers, truth).bodies.filter((body) => body.isTruth).map((body) => body.pose);
  assert.deepEqual(drawn({ object: "mug", pose: there }), [there]);
  assert.deepEqual(drawn({ object: "mug", pose: there }, { truth: false }), []);
  assert.deepEqual(drawn({ object: "mug" }), []);
  assert.deepEqual(drawn({ object: null }), []);
  assert.deepEqual(drawn({ object: "cup", pose: there }), [], "its shape is not there yet");
  assert.deepEqual(drawn(undefined), []);
});
