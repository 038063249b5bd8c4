// Numbers, times and colour scales as people read them.
import assert from "node:assert/strict";
import { test } from "node:test";
import * as format from "../../src/format.ts";

/** Each value with what is shown for it. */
function check(show, ...cases) {
  for (const [value, shown] of cases) assert.equal(show(value), shown, `${show.name}(${value})`);
}

test("a probability is never rounded to certainty", () => {
  check(format.percent, [1, "100 %"], [0.9999, ">99.9 %"], [0.9995, ">99.9 %"], [0.9994, "99.9 %"], [0.5, "50.0 %"], [0.0005, "0.1 %"], [0.0004, "<0.1 %"], [0, "0 %"]);
});

test("bits have two digits, and a dash if unknown", () => {
  check(format.bits, [2, "2.00 bit"], [0.005, "0.01 bit"], [null, "–"], [undefined, "–"]);
});

test("signed bits have a sign unless they round to zero", () => {
  check(format.signedBits, [1.234, "+1.23"], [-1.236, "−1.24"], [0.004, "0.00"], [-0.004, "0.00"], [null, "–"]);
});

test("lengths are millimetres, pressures kilopascal from 1000 Pa", () => {
  check(format.mm, [0.0025, "2.5 mm"], [0.1234, "123 mm"], [-0.0761, "−76.1 mm"], [-0.00004, "0.0 mm"]);
  check(format.kPa, [999, "999 Pa"], [1000, "1.0 kPa"], [-2500, "−2.5 kPa"], [1_234_560, "1234.6 kPa"]);
});

test("bytes have three digits and decimal units, as those of the server", () => {
  check(format.bytes, [0, "0 B"], [999, "999 B"], [1000, "1.00 kB"], [12_345, "12.3 kB"], [370_294, "370 kB"], [999_499, "999 kB"], [999_500, "1.00 MB"], [64 * 2 ** 20, "67.1 MB"], [2.5e9, "2.50 GB"], [3e15, "3000 TB"]);
});

test("counts and nouns agree", () => {
  assert.equal(format.plural(1, "reading"), "1 reading");
  assert.equal(format.plural(12_000, "reading"), "12,000 readings");
  assert.equal(format.plural(2, "axis", "axes"), "2 axes");
});

test("ages go from seconds to days, and never into the future", () => {
  check(format.age, [-5, "0 s"], [59_400, "59 s"], [60_000, "1 min"], [3_599_000, "59 min"], [7_200_000, "2 h"], [86_400_000, "1 d"]);
});

test("durations keep tenths below ten seconds", () => {
  check(format.duration, [2.44, "2.4 s"], [12.6, "13 s"], [90, "1 min 30 s"]);
});

test("times are local, to the second", () => {
  // The tests run in Kolkata: 5 h 30 min ahead.
  assert.equal(format.when("2026-03-01T20:04:05Z"), "2026-03-02 01:34:05");
  assert.equal(format.when(null), "–");
});

test("a symmetry is said in words", () => {
  const axes = [{ order: 16 }, ...Array.from({ length: 16 }, () => ({ order: 2 })), { order: null }];
  assert.equal(format.symmetryWords({ symmetry: axes }), "16-fold, 16 × 2-fold, round");
  assert.equal(format.symmetryWords({ symmetry: [] }), "none");
  assert.equal(format.symmetryWords({}), "not determined");
  assert.equal(format.symmetryWords({ symmetry_by: "undetermined", symmetry_touches_needed: 40 }), "undetermined, 40 more touches needed");
});

test("ids of one hour are told apart by their end", () => {
  assert.equal(format.shortId("01a21594-ff60-7348-948c-838bff1cfddb"), "ff1cfddb");
});

test("the scale of bits is grey at zero and full from four bits on", () => {
  assert.equal(format.bitsColor(0), format.bitsColor(null));
  assert.equal(format.bitsColor(4), format.bitsColor(40));
  assert.equal(format.bitsColor(-4), "#e85c0a");
  assert.equal(format.bitsColor(4), "#106ee0");
  // A quarter of the way: 0.25 ** 0.6 = 0.4353 of the way from grey (64, 74, 84) to blue (16, 110, 224).
  assert.equal(format.bitsColor(1), "#2b5a91");
});

test("the scale of pressure runs from dark blue to pale yellow", () => {
  assert.deepEqual(format.heat(0), [30, 34, 62]);
  assert.deepEqual(format.heat(1), [246, 230, 130]);
  assert.deepEqual(format.heat(2), format.heat(1));
  // Half way between the second and the third of five colours.
  assert.deepEqual(format.heat(0.375), [34, 108.5, 131.5]);
});

test("appearance classes have different colours, and grey without one", () => {
  const first = Array.from({ length: 25 }, (_, i) => format.classColor(i));
  assert.equal(new Set(first).size, 25);
  assert.equal(format.classColor(null), "#8a949e");
  // Hue 0, saturation 0.62, lightness 0.46: red 0.46 + 0.62 · 0.46 of 255, the others 0.46 − that.
  assert.equal(format.classColor(0), "#be2d2d");
});
