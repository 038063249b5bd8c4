// Metrics of the page Health, from the Prometheus text format.
import assert from "node:assert/strict";
import { test } from "node:test";
import { parseMetrics, quantile, total } from "../../src/health/metrics.ts";

const TEXT = `# HELP requests_total Requests.
# TYPE requests_total counter
requests_total{method="GET",status="200"} 40
requests_total{method="GET",status="500"} 2
requests_total{method="POST",status="200"} 8
sessions_open 7
seconds_bucket{route="a",le="0.1"} 50
seconds_bucket{route="a",le="1"} 89
seconds_bucket{route="a",le="+Inf"} 90
seconds_bucket{route="b",le="0.1"} 0
seconds_bucket{route="b",le="1"} 5
seconds_bucket{route="b",le="+Inf"} 10
`;
const samples = parseMetrics(TEXT);

test("comments and empty lines are no samples", () => {
  assert.equal(samples.length, 10);
});

test("a sample has its labels and its number", () => {
  assert.deepEqual(samples[0], { name: "requests_total", labels: { method: "GET", status: "200" }, value: 40 });
  assert.deepEqual(samples[3], { name: "sessions_open", labels: {}, value: 7 });
});

test("label values may hold braces, commas and quoted quotes", () => {
  const [one] = parseMetrics(String.raw`x{route="/v1/{id},a",said="\"yes\""} 1.5e3`);
  assert.deepEqual(one, { name: "x", labels: { route: "/v1/{id},a", said: String.raw`\"yes\"` }, value: 1500 });
});

test("a total counts only its own name and labels", () => {
  assert.equal(total(samples, "requests_total"), 50);
  assert.equal(total(samples, "requests_total", (labels) => labels.status === "200"), 48);
  assert.equal(total(samples, "requests"), 0);
});

test("a quantile adds the buckets of all routes", () => {
  // Of 100 requests 50 took up to 0.1 s, 94 up to 1 s.
  assert.equal(quantile(samples, "seconds", 0.5), 0.1);
  assert.equal(quantile(samples, "seconds", 0.51), 1);
  assert.equal(quantile(samples, "seconds", 0.94), 1);
  assert.equal(quantile(samples, "seconds", 0.95), Infinity);
});

test("buckets count in the order of their bounds, not of the text", () => {
  const mixed = parseMetrics('s_bucket{le="+Inf"} 4\ns_bucket{le="10"} 4\ns_bucket{le="2"} 3\n');
  assert.equal(quantile(mixed, "s", 0.75), 2);
  assert.equal(quantile(mixed, "s", 0.76), 10);
});

test("without requests there is no quantile", () => {
  assert.equal(quantile(samples, "missing", 0.5), undefined);
});
