// Of a long grid only the rows near the window are elements; the space of the others stays.
import assert from "node:assert/strict";
import { test } from "node:test";
import { matches, nearWindow } from "../../src/objects/window.ts";

const grid = { count: 2000, columns: 6, rowPx: 240, windowPx: 900 };

test("at the top the first rows are drawn, and the rest is space", () => {
  const near = nearWindow({ ...grid, topPx: 300 });
  assert.deepEqual([near.from, near.abovePx], [0, 0]);
  assert.ok(near.to >= 18 && near.to < 60, `${near.to} items`);
  assert.equal(near.to % grid.columns, 0, "whole rows");
});

test("wherever it is scrolled, items and space make the whole height", () => {
  const rows = Math.ceil(grid.count / grid.columns);
  for (let topPx = 500; topPx > -rows * grid.rowPx - 500; topPx -= 170) {
    const near = nearWindow({ ...grid, topPx });
    const drawn = Math.ceil((near.to - near.from) / grid.columns) * grid.rowPx;
    assert.equal(near.abovePx + drawn + near.belowPx, rows * grid.rowPx);
    assert.ok(near.to - near.from <= 70, `${near.to - near.from} items at ${topPx}`);
  }
});

test("at the end the last item is drawn, though its row is not full", () => {
  const rows = Math.ceil(grid.count / grid.columns);
  const near = nearWindow({ ...grid, topPx: grid.windowPx - rows * grid.rowPx });
  assert.deepEqual([near.to, near.belowPx], [2000, 0]);
});

test("a grid that fits has no space around it", () => {
  assert.deepEqual(nearWindow({ ...grid, count: 5, topPx: 200 }), { from: 0, to: 5, abovePx: 0, belowPx: 0 });
});

test("a search finds words in any order and case", () => {
  assert.ok(matches("Coffee Mug 3", "mug coff"));
  assert.ok(!matches("Coffee Mug 3", "mug cup"));
});
