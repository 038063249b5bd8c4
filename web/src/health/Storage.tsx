// Stored bytes: the largest things, and the bytes of each key.
import type { Storage } from "../api/types";
import { bytes } from "../format";

export function StorageTables({ storage }: { storage: Storage }) {
  const quota = storage.quota_bytes == null ? "no quota" : `quota per key ${bytes(storage.quota_bytes)}`;
  return (
    <>
      <p class="faint">{bytes(storage.live_bytes)} live, {bytes(storage.stored_bytes)} on the disk, {quota}</p>
      <div class="grid grid-2">
        <Table
          head="Largest"
          rows={storage.largest.map((thing) => [`${thing.kind} ${thing.name}`, thing.bytes])}
          empty="Nothing is stored."
        />
        <Table
          head="Key"
          rows={storage.holders.map(({ key, bytes }) => [key ? (key.key_name ?? key.key_id) : "without keys", bytes])}
          empty="No bytes by key."
        />
      </div>
    </>
  );
}

function Table({ head, rows, empty }: { head: string; rows: [string, number][]; empty: string }) {
  if (rows.length === 0) return <p class="faint">{empty}</p>;
  return (
    <table>
      <thead><tr><th scope="col">{head}</th><th scope="col" class="num">Bytes</th></tr></thead>
      <tbody>
        {rows.map(([name, held]) => (
          <tr key={name}><th scope="row">{name}</th><td class="num">{bytes(held)}</td></tr>
        ))}
      </tbody>
    </table>
  );
}
