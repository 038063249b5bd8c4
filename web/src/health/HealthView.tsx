// Health of the server: checks, metrics and version.
import { ask, getJson } from "../api/http";
import { useResource } from "../api/resource";
import type { Forwarding, Readiness, Storage, Version } from "../api/types";
import { bytes, count } from "../format";
import { Show } from "../parts/Notes";
import { who } from "../signin";
import { Badge, Panel, ViewHead } from "../parts/Panel";
import { Table } from "../parts/Table";
import { ForwardingPanel } from "./Forwarding";
import { StorageTables } from "./Storage";
import { parseMetrics, quantile, total, type Sample } from "./metrics";

const EVERY_MS = 5000;
const STORAGE_EVERY_MS = 60_000;

export function HealthView() {
  const ready = useResource("readyz", (signal) => getJson<Readiness>("/readyz", signal), EVERY_MS);
  const version = useResource("version", (signal) => getJson<Version>("/version", signal));
  const metrics = useResource("metrics", async (signal) => parseMetrics(await (await ask("/metrics", { signal })).text()), EVERY_MS);
  const forwarding = useResource("forwarding", (signal) => getJson<Forwarding>("/v1/forwarding", signal), EVERY_MS);
  const storage = useResource("storage", (signal) => getJson<Storage>("/v1/storage", signal), STORAGE_EVERY_MS);
  return (
    <>
      <ViewHead title="Health" sub={version.data ? `${version.data.name} ${version.data.version}, API ${version.data.api}` : "State of the server"}>
        {ready.data && <Badge kind={ready.data.ready ? "good" : "bad"}>{ready.data.ready ? "ready" : "not ready"}</Badge>}
        {ready.problem && <Badge kind="bad">not ready</Badge>}
      </ViewHead>
      <div class="grid grid-2">
        <Panel title="Checks" class="panel-checks">
          <Show of={ready} what="the checks" lines={5}>
            {(found) => <Checks checks={found.checks} />}
          </Show>
        </Panel>
        <Panel title="Metrics" class="panel-figures" aside={who.value?.keys_required ? "" : <a href="/metrics">all metrics</a>}>
          <Show of={metrics} what="the metrics" lines={5}>
            {(samples) => <Figures samples={samples} />}
          </Show>
        </Panel>
      </div>
      {forwarding.data?.to && <ForwardingPanel state={forwarding.data} />}
      <Panel title="Storage" class="panel-storage">
        <Show of={storage} what="the storage" lines={4}>
          {(found) => <StorageTables storage={found} />}
        </Show>
      </Panel>
      <Panel title="Requests">
        <Show of={metrics} what="the requests" lines={6}>
          {(samples) => <Requests samples={samples} />}
        </Show>
      </Panel>
      <p class="faint foot">
        This page contains third-party code: <a href="/assets/licences.txt">licences</a>.
      </p>
    </>
  );
}

function Checks({ checks }: { checks: Readiness["checks"] }) {
  return (
    <table>
      <thead><tr><th scope="col">Check</th><th scope="col">State</th><th scope="col">Finding</th></tr></thead>
      <tbody>
        {checks.map((check) => (
          <tr key={check.name}>
            <th scope="row">{check.name}</th>
            <td><Badge kind={check.passed ? "good" : "bad"}>{check.passed ? "passed" : "failed"}</Badge></td>
            <td>{check.detail}</td>
          </tr>
        ))}
      </tbody>
    </table>
  );
}

function Figures({ samples }: { samples: Sample[] }) {
  const p95 = quantile(samples, "palpate_http_request_seconds", 0.95);
  const failed = total(samples, "palpate_http_requests_total", (labels) => (labels.status ?? "").startsWith("5"));
  const stats: [string, string][] = [
    ["readings stored", count(total(samples, "palpate_readings_total"))],
    ["sessions in memory", count(total(samples, "palpate_sessions_in_memory"))],
    ["unfinished jobs", count(total(samples, "palpate_jobs_unfinished"))],
    ["free compute places", count(total(samples, "palpate_compute_places_free"))],
    ["models in memory", bytes(total(samples, "palpate_model_bytes"))],
    ["on the disk", bytes(total(samples, "palpate_store_bytes"))],
    ["live data", bytes(total(samples, "palpate_store_live_bytes"))],
    ["free disk space", bytes(total(samples, "palpate_store_free_bytes"))],
    ["requests", count(total(samples, "palpate_http_requests_total"))],
    ["answers with 5xx", count(failed)],
    ["95th percentile latency", p95 === undefined ? "–" : Number.isFinite(p95) ? `≤ ${p95 < 1 ? `${p95 * 1000} ms` : `${p95} s`}` : "> 30 s"],
  ];
  return (
    <dl class="stats">
      {stats.map(([name, value]) => (
        <div key={name} class="stat stat-turned">
          <dt class="faint">{name}</dt>
          <dd><b>{value}</b></dd>
        </div>
      ))}
    </dl>
  );
}

function Requests({ samples }: { samples: Sample[] }) {
  const routes = new Map<string, { n: number; failed: number; seconds: number }>();
  for (const { name, labels, value } of samples) {
    const route = `${labels.method} ${labels.route}`;
    const row = routes.get(route) ?? { n: 0, failed: 0, seconds: 0 };
    if (name === "palpate_http_requests_total") {
      row.n += value;
      if (/^[45]/.test(labels.status ?? "")) row.failed += value;
    } else if (name === "palpate_http_request_seconds_sum") row.seconds += value;
    else continue;
    routes.set(route, row);
  }
  const rows = [...routes].sort((a, b) => b[1].n - a[1].n).slice(0, 15);
  return (
    <Table label="Requests by route" columns={["Route", ["Requests", "num"], ["Refused or failed", "num"], ["Mean", "num"]]}>
      {rows.map(([route, { n, failed, seconds }]) => (
        <tr key={route}>
          <th scope="row"><code>{route}</code></th>
          <td class="num">{count(n)}</td>
          <td class="num">{count(failed)}</td>
          <td class="num">{n > 0 ? `${((seconds / n) * 1000).toFixed(1)} ms` : "–"}</td>
        </tr>
      ))}
    </Table>
  );
}
