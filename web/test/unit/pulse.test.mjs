// The one state of the connection, which every word on the page is drawn from.
import assert from "node:assert/strict";
import { beforeEach, mock, test } from "node:test";
import { asking, closed, heard, isLive, missed, opened, silentSince, STREAM_SILENT_MS } from "../../src/api/pulse.ts";
import { now } from "../../src/format.ts";

mock.timers.enable({ apis: ["setTimeout", "Date"], now: 1_000_000 });
globalThis.fetch = async () => ({ ok: true });
const wait = (ms) => {
  mock.timers.tick(ms);
  now.value = Date.now();
};
beforeEach(() => {
  wait(1);
  heard();
});

test("a request that is refused makes the page silent since it was last heard", () => {
  const last = Date.now();
  wait(3000);
  missed(Date.now());
  assert.equal(silentSince.value, last);
  heard();
  assert.equal(silentSince.value, undefined);
});

test("what was asked before the server was heard says nothing about it", () => {
  const begun = Date.now();
  wait(10);
  heard();
  missed(begun);
  assert.equal(silentSince.value, undefined);
});

test("an open stream that is heard is live, a refused request is stronger", () => {
  const line = opened();
  assert.equal(isLive.value, true);
  wait(10);
  missed(Date.now());
  assert.equal(isLive.value, false);
  heard();
  closed(line);
  assert.equal(isLive.value, false);
});

test("a stream without keep-alives is silent, though the server answers", () => {
  const line = opened();
  const since = line.heardAt;
  wait(STREAM_SILENT_MS - 1);
  heard();
  assert.equal(silentSince.value, undefined);
  wait(1);
  heard();
  assert.equal(silentSince.value, since);
  closed(line);
  assert.equal(silentSince.value, undefined);
});

test("a request without an answer is silence within two seconds", () => {
  globalThis.fetch = () => new Promise(() => {});
  const answered = asking();
  wait(1000);
  assert.equal(silentSince.value, undefined, "the server is probed first");
  wait(900);
  assert.notEqual(silentSince.value, undefined);
  answered();
});
