// Webhooks and deliveries in words.
import type { Webhook, WebhookDelivery, WebhookEventType } from "../api/types";
import { duration, when } from "../format";

/** The types of events that a webhook can subscribe to, and when they happen. */
export const EVENTS: [WebhookEventType, string][] = [
  ["session.decided", "a session with a risk has recognised its object"],
  ["session.unknown", "a session with a risk has found none of the known objects"],
  ["session.needs_attention", "a session is surprising or stuck"],
  ["training.finished", "a training or recalibration succeeded or failed"],
  ["snapshot.made", "a snapshot was taken"],
  ["snapshot.failed", "a snapshot broke off"],
];

/** A state and the colour that repeats it. */
export type Words = [kind: "good" | "warn" | "bad" | "working", words: string];

export function webhookState(webhook: Webhook): Words {
  if (!webhook.enabled) return ["bad", webhook.disabled_reason ? `disabled: ${webhook.disabled_reason}` : "disabled"];
  if (webhook.failing_since) return ["warn", `failing since ${when(webhook.failing_since)}`];
  return ["good", "enabled"];
}

export function deliveryState(delivery: WebhookDelivery): Words {
  switch (delivery.state) {
    case "delivered":
      return ["good", "delivered"];
    case "failed":
      return ["warn", `failed, again ${when(delivery.next_attempt_at)}`];
    case "abandoned":
      return ["bad", "abandoned"];
    default:
      return ["working", "pending"];
  }
}

/** The outcome of the newest attempt. */
export function lastAnswer(delivery: WebhookDelivery): string {
  const last = delivery.attempts.at(-1);
  if (!last) return "no attempt yet";
  return answerOf(last);
}

/** The outcome of an attempt and the time that it took. */
export function answerOf(attempt: WebhookDelivery["attempts"][number]): string {
  const took = attempt.duration_ms < 1000 ? `${attempt.duration_ms} ms` : duration(attempt.duration_ms / 1000);
  return `${attempt.error ?? attempt.status} after ${took}`;
}

/** The host of a URL: paths may hold secrets of the receiver. */
export function hostOf(url: string): string {
  try {
    return new URL(url).host;
  } catch {
    return url;
  }
}

/** The body of an event, indented. */
export function pretty(body: string): string {
  try {
    return JSON.stringify(JSON.parse(body), null, 2);
  } catch {
    return body;
  }
}
