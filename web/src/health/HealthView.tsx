// Health of the server: checks, metrics and version.
import { ask, getJson, isUnanswered } from "../api/http";
import { type Resource, useResource } from "../api/resource";
import type { Forwarding, Readiness, Storage, Version } from "../api/types";
import { bytes, count } from "../format";
import { Show } from "../parts/Notes";
import { who } from "../signin";
import { Badge, Panel, ViewHead } from "../parts/Panel";
import { Table } from "../parts/Table";
import { ForwardingPanel } from "./Forwarding";
import { Stats, StorageTables } from "./Storage";
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
        <Ready of={ready} />
      </ViewHead>
      <div class="grid grid-2">
        <Panel title="Checks" class="panel-checks">
          <Show of={ready} what="the checks" lines={5}>
            {(found) => <Checks checks={found.checks} />}
          </Show>
        </Panel>
        <Panel title="This process, since its start" class="panel-figures" aside={who.value?.keys_required ? "" : <a href="/metrics">all metrics</a>}>
          <Show of={metrics} what="the metrics" lines={5}>
            {(samples) => <Figures samples={samples} />}
          </Show>
        </Panel>
      </div>
      {forwarding.data?.to && <ForwardingPanel state={forwarding.data} />}
      <Panel title="What is stored" class="panel-storage">
        <Show of={storage} what="the storage" lines={4}>
          {(found) => <StorageTables storage={found} />}
        </Show>
      </Panel>
      <Panel title="Requests, since the start of the process">
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

/** The one word about the state of the server. While it is silent, the last one with its age. */
function Ready({ of }: { of: Resource<Readiness> }) {
  // An answer *not ready* is an answer; the state before it no longer counts.
  const isRefused = of.problem !== undefined && !isUnanswered(of.problem);
  if (!isRefused && of.data === undefined) return null;
  const isReady = !isRefused && of.data!.ready;
  return <Badge kind={isReady ? "good" : "bad"}>{isReady ? "ready" : "not ready"}</Badge>;
}

/** The checks of the API in words. */
const CHECKS: Record<string, string> = {
  store: "Database", compute: "Computing", serving: "Serving", room: "Disk space", memory: "Memory", integrity: "Trained versions",
};

function Checks({ checks }: { checks: Readiness["checks"] }) {
  return (
    <Table label="Checks" columns={["Check", "State", "Finding"]}>
      {checks.map((check) => (
        <tr key={check.name}>
          <th scope="row">{CHECKS[check.name] ?? check.name}</th>
          <td><Badge kind={check.passed ? "good" : "bad"}>{check.passed ? "passed" : "failed"}</Badge></td>
          <td>{check.detail}</td>
        </tr>
      ))}
    </Table>
  );
}

/** Whether a route is one of the API whose answer ends: no picture or script of the page, no stream. */
function isApi(labels: Record<string, string>): boolean {
  return (labels.route ?? "").startsWith("/v1/") && !(labels.route ?? "").endsWith("/events");
}

function Figures({ samples }: { samples: Sample[] }) {
  const p95 = quantile(samples, "palpate_http_request_seconds", 0.95, isApi);
  const answered = (digit: string) => total(samples, "palpate_http_requests_total", (labels) => isApi(labels) && (labels.status ?? "").startsWith(digit));
  const stats: [string, string][] = [
    ["sessions in memory", count(total(samples, "palpate_sessions_in_memory"))],
    ["unfinished jobs", count(total(samples, "palpate_jobs_unfinished"))],
    ["more requests that can compute now", count(total(samples, "palpate_compute_places_free"))],
    ["models in memory", bytes(total(samples, "palpate_model_bytes"))],
    ["readings taken", count(total(samples, "palpate_readings_total"))],
    ["API requests", count(total(samples, "palpate_http_requests_total", isApi))],
    ["refused (4xx)", count(answered("4"))],
    ["failed (5xx)", count(answered("5"))],
    ["95 % of API answers began within", p95 === undefined ? "–" : Number.isFinite(p95) ? (p95 < 1 ? `${Math.round(p95 * 1000)} ms` : `${p95} s`) : "more than 30 s"],
  ];
  return <Stats of={stats} />;
}

function Requests({ samples }: { samples: Sample[] }) {
  const routes = new Map<string, { n: number; refused: number; failed: number; seconds: number }>();
  for (const { name, labels, value } of samples) {
    const route = `${labels.method} ${labels.route}`;
    const row = routes.get(route) ?? { n: 0, refused: 0, failed: 0, seconds: 0 };
    if (name === "palpate_http_requests_total") {
      row.n += value;
      if ((labels.status ?? "").startsWith("4")) row.refused += value;
      if ((labels.status ?? "").startsWith("5")) row.failed += value;
    } else if (name === "palpate_http_request_seconds_sum") row.seconds += value;
    else continue;
    routes.set(route, row);
  }
  const rows = [...routes].sort((a, b) => b[1].n - a[1].n).slice(0, 15);
  return (
    <Table label="Requests by route" columns={["Route", ["Requests", "num"], ["Refused (4xx)", "num"], ["Failed (5xx)", "num"], ["Mean (ms)", "num"]]}>
      {rows.map(([route, { n, refused, failed, seconds }]) => (
        <tr key={route}>
          <th scope="row"><code>{route}</code></th>
          <td class="num">{count(n)}</td>
          <td class="num">{count(refused)}</td>
          <td class="num">{count(failed)}</td>
          <td class="num">{n > 0 ? ((seconds / n) * 1000).toFixed(1) : "–"}</td>
        </tr>
      ))}
    </Table>
  );
}
