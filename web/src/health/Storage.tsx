// What is stored, by the store itself: readings and bytes, the largest things, and the bytes of each key.
import type { Storage } from "../api/types";
import { bytes, count } from "../format";

export function StorageTables({ storage }: { storage: Storage }) {
  const stats: [string, string][] = [
    ["readings stored", count(storage.n_readings ?? 0)],
    ["on the disk", bytes(storage.stored_bytes)],
    ["of these in use, the rest a compaction frees", bytes(storage.live_bytes)],
    ["free on the disk", storage.free_bytes == null ? "unknown" : bytes(storage.free_bytes)],
    ["stay free", bytes(storage.reserve_bytes)],
    ["quota of each key", storage.quota_bytes == null ? "none" : bytes(storage.quota_bytes)],
  ];
  return (
    <div class="stack">
      <Stats of={stats} />
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
    </div>
  );
}

/** Large figures, each with its name. */
export function Stats({ of: stats }: { of: [string, string][] }) {
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

function Table({ head, rows, empty }: { head: string; rows: [string, number][]; empty: string }) {
  if (rows.length === 0) return <p class="faint">{empty}</p>;
  return (
    <table>
      <thead><tr><th scope="col">{head}</th><th scope="col" class="num">Size</th></tr></thead>
      <tbody>
        {rows.map(([name, held]) => (
          <tr key={name}><th scope="row">{name}</th><td class="num">{bytes(held)}</td></tr>
        ))}
      </tbody>
    </table>
  );
}
