// Server-sent events: blocks of lines to events.
import assert from "node:assert/strict";
import { test } from "node:test";
import { parse, pause } from "../../src/api/events.ts";

test("an event has its name and its data", () => {
  assert.deepEqual(parse('event: belief\nid: 4\ndata: {"a":1}'), { name: "belief", data: '{"a":1}' });
});

test("an event without a name is a message", () => {
  assert.deepEqual(parse("data:x"), { name: "message", data: "x" });
});

test("lines of data are joined, and lose one space only", () => {
  assert.deepEqual(parse("data:  one\r\ndata: two\r\ndata:"), { name: "message", data: " one\ntwo\n" });
});

test("a keep-alive comment is no event", () => {
  assert.equal(parse(": keep-alive"), null);
  assert.equal(parse("event: belief"), null);
});

test("a pause ends when it is aborted", async () => {
  const abort = new AbortController();
  const long = pause(60_000, abort.signal);
  abort.abort();
  await long;
});
