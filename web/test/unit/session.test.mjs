// What a session's page shows of what it has heard.
import assert from "node:assert/strict";
import { beforeEach, test } from "node:test";
import { counts, hasLooseBase } from "../../src/session/content.ts";
import { fromPrior, SessionModel, stepOf } from "../../src/session/model.ts";
import { wouldTeach } from "../../src/session/NextTouch.tsx";
import { closer, identities } from "../../src/session/posterior.ts";

const belief = (revision) => ({ revision, n_readings: revision, objects: [], poses: [], entropy_bits: 2 });
let model;
beforeEach(() => {
  model = new SessionModel("01a21594");
});

test("the page follows the newest revision", () => {
  assert.equal(model.revision.value, 0);
  model.newest.value = belief(4);
  assert.equal(model.revision.value, 4);
  assert.equal(model.shown.value.revision, 4);
  assert.equal(model.isStale.value, false);
});

test("until a past revision has arrived, the one shown before is stale", () => {
  model.newest.value = belief(4);
  assert.equal(model.shownRevision.value, 4);
  model.at.value = 2;
  assert.equal(model.revision.value, 2);
  assert.equal(model.shownRevision.value, 4);
  assert.equal(model.isStale.value, true);
});

test("a reading counts from its arrival to its retraction", () => {
  const reading = { number: 3, retracted_by: 6 };
  // The reading with number 3 is the fourth, and makes revision 4.
  assert.deepEqual([3, 4, 5, 6, 7].map((revision) => counts(reading, revision)), [false, true, true, false, false]);
  assert.equal(counts({ number: 3, retracted_by: null }, 100), true);
});

test("a loose base is that of a robot which the session lists", () => {
  const session = { robots: [{ robot: "arm-1", base: { position_m: 0.1, angle_rad: 1 } }] };
  assert.deepEqual(["arm-1", "arm-2", null].map((robot) => hasLooseBase(session, { robot })), [true, false, false]);
  assert.equal(hasLooseBase({ robots: null }, { robot: "arm-1" }), false);
  assert.equal(hasLooseBase(undefined, { robot: "arm-1" }), false);
});

const reading = (number, bits, fit) => ({ number, bits, fit_bits: fit });
const best = (name, probability) => ({ object: name, name, probability });

test("touches are coloured by bits while readings contribute some", () => {
  model.explanation.value = { readings: [reading(0, 0.2, 9), reading(1, null, -3)] };
  assert.equal(model.coloring.value, "bits");
  assert.deepEqual([...model.tints.value], [[0, 0.2], [1, null]]);
});

test("touches are coloured by fit once no reading contributes", () => {
  model.explanation.value = { readings: [reading(0, 0.01, 9), reading(1, -0.04, -3)] };
  assert.equal(model.coloring.value, "fit");
});

test("without fits and contributions, touches are coloured by what they changed when they came", () => {
  model.explanation.value = { answer: { object: "mug", name: "mug", probability: 0.8 }, readings: [reading(0, 0, null), reading(1, 0, null)] };
  assert.equal(model.coloring.value, "came");
  const step = (revision, probability) => ({ revision, n_readings: revision, objects: [best("mug", probability)], unknown: 0.1, entropyBits: 1 });
  model.prior.value = { ...belief(0), objects: [best("mug", 0.1)] };
  model.steps.value = [step(1, 0.4), step(2, 0.8)];
  model.readings.value = [{ number: 0 }, { number: 1 }, { number: 2 }];
  // Of 3 bits from the prior to now, the first reading brought 2 and the second 1; the third has no step yet.
  const came = [...model.came.value].map(([number, bits]) => [number, bits && Math.round(bits * 1e9) / 1e9]);
  assert.deepEqual(came, [[0, 2], [1, 1], [2, undefined]]);
  assert.equal(model.valueOf({ number: 1 }), model.came.value.get(1));
});

test("what made a revision is what the server lists", () => {
  model.readings.value = [{ number: 0, retracted_by: 3 }, { number: 1 }];
  assert.deepEqual([1, 2, 3, 4].map((revision) => model.changeAt(revision)), ["reading", "reading", "retraction", undefined]);
});

test("without fits nothing is coloured by fit unless chosen", () => {
  model.explanation.value = { readings: [reading(0, 0.2, null)] };
  assert.equal(model.coloring.value, "bits");
  model.colorBy.value = "fit";
  assert.equal(model.coloring.value, "fit");
  assert.deepEqual([...model.tints.value], [[0, null]]);
});


test("a live belief makes a step with its ten likeliest objects", () => {
  const objects = Array.from({ length: 12 }, (_, i) => best(`o${i}`, 1 / 12));
  const step = stepOf({ ...belief(5), objects, unknown: 0.25 });
  assert.equal(step.revision, 5);
  assert.equal(step.nReadings, 5);
  assert.deepEqual(step.objects.map((one) => one.name), objects.slice(0, 10).map((one) => one.name));
  assert.equal(step.unknown, 0.25);
  assert.equal(step.entropyBits, 2);
  assert.equal(stepOf({ ...belief(5), objects }).unknown, 0);
});

const step = (revision, objects, unknown = 0) => ({ revision, nReadings: revision, objects, unknown, entropyBits: 1 });

test("the posterior has a line for each object, the likeliest now first", () => {
  const lines = identities([step(1, [best("mug", 0.6), best("gear", 0.4)]), step(2, [best("gear", 0.9)])]);
  assert.deepEqual(lines.map((one) => one.label), ["gear", "mug"]);
  assert.deepEqual(lines[0].values, [0.4, 0.9]);
  assert.deepEqual(lines[1].values, [0.6, 0]);
});

test("objects that were likely before are preferred to those that never were", () => {
  const once = Array.from({ length: 9 }, (_, i) => best(`o${i}`, (i + 1) / 100));
  const labels = identities([step(1, once), step(2, [best("mug", 1)])]).map((one) => one.label);
  assert.deepEqual(labels, ["mug", "o8", "o7", "o6", "o5", "o4"]);
});

test("none of these has a dashed line if it ever was possible", () => {
  const lines = identities([step(1, [best("mug", 0.7)], 0.3), step(2, [best("mug", 1)])]);
  assert.deepEqual(lines.map((one) => one.label), ["mug", "none of these"]);
  assert.deepEqual(lines[1].values, [0.3, 0]);
  assert.equal(lines[1].dashed, true);
  assert.equal(identities([step(1, [best("mug", 1)])]).length, 1);
});

test("the posterior begins at the prior, which adds no line of its own", () => {
  const prior = { revision: 0, n_readings: 0, objects: [best("mug", 0.3), best("gear", 0.3), best("hand", 0.3)], unknown: 0.1, entropy_bits: 1.9 };
  const steps = fromPrior(prior, [step(1, [best("gear", 0.9), best("mug", 0.1)])]);
  assert.deepEqual(steps.map((one) => one.revision), [0, 1]);
  assert.equal(steps[0].entropyBits, 1.9);
  const lines = identities(steps);
  assert.deepEqual(lines.map((one) => one.label), ["gear", "mug", "none of these"]);
  assert.deepEqual(lines[0].values, [0.3, 0.9]);
});

test("a prior with many objects keeps all of them", () => {
  const prior = { revision: 0, n_readings: 0, objects: Array.from({ length: 40 }, (_, i) => best(`o${i}`, 0.025)), entropy_bits: 5.3 };
  const lines = identities(fromPrior(prior, [step(1, [best("o39", 1)])]));
  assert.deepEqual(lines, [{ label: "o39", color: lines[0].color, values: [0.025, 1] }]);
});

test("without readings there is nothing to draw", () => {
  assert.deepEqual(fromPrior(belief(0), []), []);
});

test("zooming in halves the range about the revision, within it", () => {
  assert.deepEqual(closer([0, 100], 50), [25, 75]);
  assert.deepEqual(closer([0, 100], 100), [50, 100]);
  assert.deepEqual(closer([20, 60], 0), [20, 40]);
  assert.equal(closer([4, 5], 4), undefined);
});

test("the scale of fits ends at the largest fit, that of bits at four", () => {
  model.explanation.value = { readings: [reading(0, 0, 24), reading(1, 0, -8)] };
  assert.equal(model.fullAt.value, 24);
  assert.deepEqual([...model.tints.value], [[0, 4], [1, -4 / 3]]);
  model.colorBy.value = "bits";
  assert.equal(model.fullAt.value, 4);
});

test("a reading shows the value that it is coloured by", () => {
  model.explanation.value = { readings: [reading(0, 0, 24)] };
  assert.equal(model.valueOf(reading(0, 0, 24)), 24);
  model.colorBy.value = "bits";
  assert.equal(model.valueOf(reading(0, 0, 24)), 0);
  assert.equal(model.valueOf(undefined), undefined);
});

test("touches that add less than a hundredth of a bit teach nothing", () => {
  assert.equal(wouldTeach({ information_bits: 0.004, pose_bits: 0.005 }), false);
  assert.equal(wouldTeach({ information_bits: 0.005, pose_bits: 0.005 }), true);
  assert.equal(wouldTeach({ information_bits: 0.02, pose_bits: null }), true);
});
