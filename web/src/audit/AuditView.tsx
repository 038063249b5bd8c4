// The audit log: who changed what, and who was refused.
import { usePages } from "../api/pages";
import type { AuditEntry } from "../api/types";
import { plural, when } from "../format";
import { Filters } from "../parts/Filters";
import { More } from "../parts/More";
import { Empty, Show } from "../parts/Notes";
import { Badge, Panel, ViewHead } from "../parts/Panel";
import { SearchField } from "../parts/SearchField";
import { Table } from "../parts/Table";
import { choose, useChoice } from "../router";

const PAGE = 100;

export function AuditView() {
  const [key, setKey] = useChoice("key");
  const [operation, setOperation] = useChoice("operation");
  const [ring, setRing] = useChoice("ring");
  const query = new URLSearchParams({ limit: String(PAGE) });
  if (key.trim()) query.set("key", key.trim());
  if (operation.trim()) query.set("operation", operation.trim());
  if (ring) query.set("ring", ring);
  const list = usePages<AuditEntry>(`/v1/audit?${query}`, (entry) => entry.seq);
  const entries = list.data?.items ?? [];
  const hasMore = list.data?.hasMore ?? false;
  const nSet = [key, operation, ring].filter((value) => value !== "").length;
  return (
    <>
      <ViewHead title="Audit" sub="Every change and every refusal, newest first">
        <button type="button" onClick={list.reload}>Reload</button>
      </ViewHead>
      <Filters nSet={nSet} onClear={() => choose({ key: "", operation: "", ring: "", pages: "" })}>
        <SearchField id="audit-key" label="Key (name or id)" isWhole value={key} onSearch={setKey} />
        <SearchField id="audit-operation" label="Operation" isWhole value={operation} placeholder="delete_object" onSearch={setOperation} />
        <div class="field">
          <label for="audit-ring">What happened</label>
          <select id="audit-ring" value={ring} onChange={(event) => setRing(event.currentTarget.value)}>
            <option value="">everything</option>
            <option value="changes">changes</option>
            <option value="refused">refused to keys</option>
            <option value="strangers">refused without a key</option>
          </select>
        </div>
      </Filters>
      <Show of={list} what="the audit log" lines={8}>
        {() =>
          entries.length === 0 && !hasMore ? (
            <Empty title="No entry fits" />
          ) : (
            <Panel title="Entries" aside={plural(entries.length, "entry", "entries") + (hasMore ? " and more" : "")}>
              <Table label="Audit log" columns={["When", "Who", "Operation", "On", "Outcome", "From"]}>
                {entries.map((entry) => <Row key={entry.seq} entry={entry} />)}
              </Table>
              <More of={list} />
            </Panel>
          )
        }
      </Show>
    </>
  );
}

function Row({ entry }: { entry: AuditEntry }) {
  const status = entry.status;
  const kind = status === null || status === undefined ? "warn" : status < 400 ? "good" : "bad";
  return (
    <tr>
      <th scope="row" class="num-left">{when(entry.at)}{entry.n > 1 && <span class="faint"> {entry.n} times, last {when(entry.last_at)}</span>}</th>
      <td>{entry.key_name ?? entry.key_id ?? "without a key"}{entry.role && <span class="faint"> {entry.role}</span>}</td>
      <td><code>{entry.operation}</code></td>
      <td><code>{entry.resource}</code></td>
      <td><Badge kind={kind} isPast>{status ?? "unknown"}</Badge>{entry.n_left_out > 0 && <span class="faint"> after {entry.n_left_out} more</span>}</td>
      <td><span title={`request ${entry.request_id}`}>{entry.address}</span></td>
    </tr>
  );
}
