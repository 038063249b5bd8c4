// Snapshots: taking one from the page, and those that were taken.
import { ask, getJson } from "../api/http";
import { useResource } from "../api/resource";
import type { AuditEntry, Page, Storage } from "../api/types";
import { bytes, when } from "../format";
import { saveBlob } from "../parts/save";
import { Empty, ProblemNote, Show } from "../parts/Notes";
import { Badge, Panel, ViewHead } from "../parts/Panel";
import { Table } from "../parts/Table";
import { useAction } from "../parts/useAction";

const TAKEN = "/v1/audit?operation=take_snapshot&limit=100";
/** A browser keeps a download in memory or in its own files until it is whole. */
const PAGE_BYTES_MAX = 2_000_000_000;
const WITHIN_MS = 3_600_000;

export function SnapshotsView() {
  const storage = useResource("storage", (signal) => getJson<Storage>("/v1/storage", signal));
  const taken = useResource(TAKEN, (signal) => getJson<Page<AuditEntry>>(TAKEN, signal));
  const action = useAction();
  const take = () =>
    action.run(async () => {
      const answer = await ask("/v1/snapshots", { method: "POST" }, WITHIN_MS);
      const day = new Date().toISOString().replaceAll(/[:.]/g, "-");
      saveBlob(`palpate-${day}.snapshot`, await answer.blob());
      taken.reload();
    });
  const live = storage.data?.live_bytes;
  const isLarge = (live ?? 0) > PAGE_BYTES_MAX;
  return (
    <>
      <ViewHead title="Snapshots" sub="Everything stored, as one consistent file">
        <button type="button" class="primary" disabled={action.busy || isLarge} onClick={take}>
          {action.busy ? "Taking …" : "Take a snapshot"}
        </button>
      </ViewHead>
      {action.problem && <ProblemNote problem={action.problem} />}
      <Panel title="Take and restore" {...(live === undefined ? {} : { aside: `about ${bytes(live)}` })}>
        <div class="stack">
          {isLarge && <p class="note note-warn">This is too large for a browser: take it on the command line.</p>}
          <p>The service goes on meanwhile. For backups that take themselves, keep the newest few and can be checked, use the command:</p>
          <pre class="wrap">{`palpate --server ${location.origin} snapshot backup ./backups --keep 14\npalpate snapshot verify FILE\npalpate snapshot restore FILE --data ./restored`}</pre>
        </div>
      </Panel>
      <Panel title="Taken so far">
        <Show of={taken} what="earlier snapshots" lines={4}>
          {(page) =>
            page.items.length === 0 ? <Empty title="None yet" /> : (
              <Table label="Snapshots taken" columns={["When", "By", "Outcome", "From"]}>
                {page.items.map((entry) => (
                  <tr key={entry.seq}>
                    <th scope="row" class="num-left">{when(entry.at)}</th>
                    <td>{entry.key_name ?? "without a key"}</td>
                    <td><Badge kind={(entry.status ?? 500) < 400 ? "good" : "bad"} isPast>{entry.status ?? "unknown"}</Badge></td>
                    <td>{entry.address}</td>
                  </tr>
                ))}
              </Table>
            )
          }
        </Show>
      </Panel>
    </>
  );
}
