// States of webhooks and their deliveries in words.
import assert from "node:assert/strict";
import test from "node:test";
import { deliveryState, EVENTS, hostOf, lastAnswer, pretty, webhookState } from "../../src/webhooks/words.ts";

const AT = "2026-03-01T08:00:00Z";

test("a webhook that the server disabled says why", () => {
  const webhook = { enabled: true, failing_since: null, disabled_reason: null };
  assert.deepEqual(webhookState(webhook), ["good", "enabled"]);
  const [kind, words] = webhookState({ ...webhook, failing_since: AT });
  assert.equal(kind, "warn");
  assert.match(words, /^failing since /);
  assert.deepEqual(webhookState({ ...webhook, enabled: false }), ["bad", "disabled"]);
  const gone = { ...webhook, enabled: false, disabled_reason: "410 Gone" };
  assert.deepEqual(webhookState(gone), ["bad", "disabled: 410 Gone"]);
});

test("a delivery says what comes next and what the receiver answered", () => {
  const attempt = { at: AT, duration_ms: 12, status: 500, error: "the receiver answered 500" };
  const delivery = { state: "failed", next_attempt_at: AT, attempts: [attempt] };
  assert.match(deliveryState(delivery)[1], /^failed, again /);
  assert.match(lastAnswer(delivery), /^the receiver answered 500 after /);
  const done = { state: "delivered", next_attempt_at: null, attempts: [attempt, { ...attempt, status: 204, error: null }] };
  assert.deepEqual(deliveryState(done), ["good", "delivered"]);
  assert.equal(lastAnswer(done), "204 after 12 ms");
  assert.equal(lastAnswer({ ...done, attempts: [] }), "no attempt yet");
  assert.deepEqual(deliveryState({ ...done, state: "abandoned" })[0], "bad");
});

test("only the host of a URL is shown in lists, and bodies are indented", () => {
  assert.equal(hostOf("https://hooks.example:8443/services/T0/secret"), "hooks.example:8443");
  assert.equal(hostOf("none"), "none");
  assert.equal(pretty('{"a":1}'), '{\n  "a": 1\n}');
  assert.equal(pretty("{"), "{");
});

test("every type of event is explained once", () => {
  const names = EVENTS.map(([name]) => name);
  assert.equal(new Set(names).size, 6);
  assert.ok(!names.includes("ping"));
});
