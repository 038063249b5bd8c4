// Colours belong to objects, whatever their order and whoever is added later.
import assert from "node:assert/strict";
import { beforeEach, test } from "node:test";
import { nameColors, objectColor, plainColor } from "../../src/colors.ts";
import { dark } from "../../src/format.ts";

const named = (...names) => names.map((name, i) => ({ name, created_at: `2026-01-${String(i + 1).padStart(2, "0")}T00:00:00Z` }));
const colors = (list) => list.map(({ name }) => objectColor(name));
const ten = named("mug", "hammer", "gear", "hand", "pliers", "tyre", "dragon", "wine_glass", "screwdriver", "chess_knight");

beforeEach(() => {
  dark.value = false;
});

test("up to sixteen objects have different colours", () => {
  const sixteen = [...ten, ...named("a", "b", "c", "d", "e", "f").map((one) => ({ ...one, created_at: `2026-02${one.created_at.slice(7)}` }))];
  nameColors(sixteen);
  assert.equal(new Set(colors(sixteen)).size, 16);
});

test("the order of the list changes no colour", () => {
  nameColors(ten);
  const before = colors(ten);
  nameColors([...ten].reverse());
  assert.deepEqual(colors(ten), before);
});

test("an added object changes no colour of an older one", () => {
  nameColors(ten.slice(0, 4));
  const before = colors(ten.slice(0, 4));
  nameColors(ten);
  assert.deepEqual(colors(ten.slice(0, 4)), before);
});

test("the dark theme has its own colours, as many", () => {
  nameColors(ten);
  const light = colors(ten);
  dark.value = true;
  assert.equal(new Set(colors(ten)).size, 10);
  assert.ok(colors(ten).every((color, i) => color !== light[i]));
});

test("an object that was not listed has a colour of its name", () => {
  nameColors([]);
  assert.equal(objectColor("stranger"), objectColor("stranger"));
  assert.match(objectColor("stranger"), /^#[0-9a-f]{6}$/);
});

test("no object has the grey of none of these", () => {
  nameColors(ten);
  for (const isDark of [false, true]) {
    dark.value = isDark;
    assert.ok(!colors(ten).includes(plainColor()));
  }
});
