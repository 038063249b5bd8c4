// Formats and units of uploaded meshes.
import assert from "node:assert/strict";
import { test } from "node:test";
import { FORMATS, formatOf, meshQuery, UNITS } from "../../src/objects/mesh.ts";

test("every format is known by its name, and only those that record no unit send one", () => {
  const units = UNITS.map(([unit]) => unit);
  assert.deepEqual(units.toSorted(), ["cm", "in", "m", "mm"]);
  for (const format of FORMATS) {
    assert.equal(formatOf(`part.v2.${format.toUpperCase()}`), format);
    const hasUnit = !["glb", "3mf"].includes(format);
    for (const unit of units) assert.equal(meshQuery(format, unit), hasUnit ? `format=${format}&unit=${unit}` : `format=${format}`);
  }
  assert.equal(formatOf("part.step"), undefined);
  assert.equal(formatOf("part"), undefined);
});
