// The audit log: who changed what, and who was refused.
import { useEffect, useState } from "preact/hooks";
import { getJson } from "../api/http";
import { useResource } from "../api/resource";
import type { AuditEntry, Page } from "../api/types";
import { plural, when } from "../format";
import { Empty, ProblemNote, Show } from "../parts/Notes";
import { Badge, Panel, ViewHead } from "../parts/Panel";
import { SearchField } from "../parts/SearchField";
import { Table } from "../parts/Table";
import { useAction } from "../parts/useAction";

const PAGE = 100;

export function AuditView() {
  const [key, setKey] = useState("");
  const [operation, setOperation] = useState("");
  const [ring, setRing] = useState("");
  const [further, setFurther] = useState<{ path: string; items: AuditEntry[]; next: string | undefined }>();
  const action = useAction();
  const query = new URLSearchParams({ limit: String(PAGE) });
  if (key.trim()) query.set("key", key.trim());
  if (operation.trim()) query.set("operation", operation.trim());
  if (ring) query.set("ring", ring);
  const path = `/v1/audit?${query}`;
  const first = useResource(path, (signal) => getJson<Page<AuditEntry>>(path, signal));
  useEffect(() => setFurther(undefined), [path]);
  const more = further?.path === path ? further : undefined;
  const next = more ? more.next : (first.data?.next_cursor ?? undefined);
  const entries = [...(first.data?.items ?? []), ...(more?.items ?? [])];
  const showMore = () =>
    action.run(async () => {
      const page = await getJson<Page<AuditEntry>>(`${path}&cursor=${encodeURIComponent(next ?? "")}`);
      setFurther({ path, items: [...(more?.items ?? []), ...page.items], next: page.next_cursor ?? undefined });
    });
  return (
    <>
      <ViewHead title="Audit" sub="Every change and every refusal, newest first">
        <button type="button" onClick={first.reload}>Reload</button>
      </ViewHead>
      <form class="panel filters" aria-label="Filters" onSubmit={(event) => event.preventDefault()}>
        <SearchField id="audit-key" label="Key (name or id)" value={key} onSearch={setKey} />
        <SearchField id="audit-operation" label="Operation" value={operation} placeholder="delete_object" onSearch={setOperation} />
        <div class="field">
          <label for="audit-ring">What happened</label>
          <select id="audit-ring" value={ring} onChange={(event) => setRing(event.currentTarget.value)}>
            <option value="">everything</option>
            <option value="changes">changes</option>
            <option value="refused">refused to keys</option>
            <option value="strangers">refused without a key</option>
          </select>
        </div>
      </form>
      {action.problem && <ProblemNote problem={action.problem} />}
      <Show of={first} what="the audit log" lines={8}>
        {() =>
          entries.length === 0 && next === undefined ? (
            <Empty title="No entry fits" />
          ) : (
            <Panel title="Entries" aside={plural(entries.length, "entry", "entries") + (next === undefined ? "" : " and more")}>
              <Table label="Audit log" columns={["When", "Who", "Operation", "On", "Outcome", "From"]}>
                {entries.map((entry) => <Row key={entry.seq} entry={entry} />)}
              </Table>
              {next !== undefined && <p class="more"><button type="button" class="small" disabled={action.busy} onClick={showMore}>Show more</button></p>}
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
      <td><Badge kind={kind}>{status ?? "unknown"}</Badge>{entry.n_left_out > 0 && <span class="faint"> after {entry.n_left_out} more</span>}</td>
      <td><span title={`request ${entry.request_id}`}>{entry.address}</span></td>
    </tr>
  );
}
