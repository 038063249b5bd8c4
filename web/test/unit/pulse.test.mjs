// Whether the page may say "live".
import assert from "node:assert/strict";
import { test } from "node:test";
import { heard, NO_LINE, SILENT_MS, silence, silentFor, STREAM_SILENT_MS } from "../../src/api/pulse.ts";

heard();
const at = Date.now();

test("silence counts from when the server was last heard", () => {
  assert.ok(Math.abs(silence(at + 5000) - 5000) < 1000);
  assert.equal(silence(at - 60_000), 0);
});

test("a server heard a moment ago is live", () => {
  assert.equal(silentFor(NO_LINE, at + SILENT_MS - 1000), 0);
  assert.equal(silentFor({ open: true, heardAt: at }, at + SILENT_MS - 1000), 0);
});

test("after eight seconds of silence nothing is live", () => {
  assert.ok(silentFor({ open: true, heardAt: at + 9000 }, at + SILENT_MS + 1000) >= SILENT_MS);
});

test("an open stream without keep-alives is not live, though the server answers", () => {
  const line = { open: true, heardAt: at - STREAM_SILENT_MS - 500 };
  assert.equal(silentFor(line, at), STREAM_SILENT_MS + 500);
  assert.equal(silentFor({ ...line, open: false }, at), 0);
  assert.equal(silentFor({ open: true, heardAt: at - STREAM_SILENT_MS + 500 }, at), 0);
});
