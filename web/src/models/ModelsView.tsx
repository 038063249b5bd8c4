// Catalogues and their versions, and the switch of the current version.
import { getAll, getJson, sendJson } from "../api/http";
import { useResource } from "../api/resource";
import type { Catalogue, CatalogueVersion, Job } from "../api/types";
import { count, plural, when } from "../format";
import { TrainCommands } from "../parts/Commands";
import { Empty, ProblemNote, Show } from "../parts/Notes";
import { Badge, Panel, ViewHead } from "../parts/Panel";
import { Table } from "../parts/Table";
import { useAction } from "../parts/useAction";
import { go, link } from "../router";
import { may } from "../signin";

/** The alias of a version that may become current. */
const CANDIDATE = "candidate";

export function ModelsView() {
  const catalogues = useResource("catalogues", (signal) => getAll<Catalogue>("/v1/catalogues", 1000, signal));
  return (
    <>
      <ViewHead title="Models" sub="Catalogues of trained versions; a session keeps its version" />
      <Show of={catalogues} what="the catalogues">
        {(found) =>
          found.length === 0 ? (
            <Empty title="No trained versions yet">
              {may("trainer", "admin") && <p><a href={link("objects")}>Add and train objects</a>, or:</p>}
              <TrainCommands />
            </Empty>
          ) : (
            <>
              {found.map((catalogue) => (
                <Versions key={catalogue.name} catalogue={catalogue} reload={catalogues.reload} />
              ))}
            </>
          )
        }
      </Show>
    </>
  );
}

function Versions({ catalogue, reload }: { catalogue: Catalogue; reload: () => void }) {
  const path = `/v1/catalogues/${encodeURIComponent(catalogue.name)}`;
  const versions = useResource(`${path} ${catalogue.latest_version}`, (signal) => getAll<CatalogueVersion>(`${path}/versions`, 1000, signal));
  const action = useAction();
  const use = (version: number) =>
    action.run(async () => {
      const etag = catalogue.current ? `"${catalogue.current.revision}"` : await currentTag(path);
      await sendJson("PUT", `${path}/current`, { version }, { "if-match": etag });
      reload();
      versions.reload();
    });
  const nameIt = (alias: string, version: number) =>
    action.run(async () => {
      await sendJson("PUT", `${path}/aliases/${encodeURIComponent(alias)}`, { version });
      reload();
    });
  const compare = (version: number) =>
    action.run(async () => {
      const job = await sendJson<Job>("POST", `${path}/versions/${version}/shadow`, {});
      go("jobs", job.id);
    });
  return (
    <Panel
      title={catalogue.name}
      aside={catalogue.current ? `new sessions use version ${catalogue.current.version} since ${when(catalogue.current.changed_at)}` : "no current version"}
    >
      {action.problem && <ProblemNote problem={action.problem} retry={reload} />}
      <Show of={versions} what={`versions of ${catalogue.name}`}>
        {(found) =>
          found.length === 0 ? (
            <p class="faint">No version yet.</p>
          ) : (
            <Table label={`Versions of ${catalogue.name}`} columns={["Version", "Trained", "Objects", "Methods learnt", ["Actions", "hidden"]]}>
              {[...found].reverse().map((version) => (
                <Row key={version.version} version={version} current={catalogue.current?.version} aliases={aliasesOf(catalogue, version.version)} busy={action.busy} use={use} compare={compare} nameIt={nameIt} />
              ))}
            </Table>
          )
        }
      </Show>
    </Panel>
  );
}

interface RowProps {
  version: CatalogueVersion;
  current: number | undefined;
  aliases: string[];
  busy: boolean;
  use: (version: number) => void;
  compare: (version: number) => void;
  nameIt: (alias: string, version: number) => void;
}

function Row({ version, current, aliases, busy, use, compare, nameIt }: RowProps) {
  const isCurrent = version.version === current;
  const { report } = version;
  const names = report.objects.map((object) => object.name);
  const learnt = [
    (report.surface_bytes ?? 0) > 0 && "surface matching",
    report.n_classes > 0 && "pairs of touches",
    report.appearance && "touch images alone",
    report.objects.some((object) => object.geometric) && "contact maps",
  ].filter(Boolean);
  return (
    <tr>
      <th scope="row">
        <a href={link("models", version.catalogue, version.version)}>Version {version.version}</a>
      </th>
      <td class="num-left">{when(version.created_at)}</td>
      <td>{plural(names.length, "object")} <span class="faint wide-only">{names.slice(0, 6).join(", ")}{names.length > 6 ? " …" : ""}</span></td>
      <td>{learnt.join(", ")}{version.merged_from.length > 0 && " · merged"}</td>
      <td class="row-end">
        {aliases.map((alias) => <Badge key={alias} kind="label">{alias}</Badge>)}
        {version.damage ? <Badge kind="bad">damaged</Badge> : isCurrent ? <Badge kind="current">current</Badge> : (
          may("trainer", "admin") && (
            <>
              {current !== undefined && (report.surface_bytes ?? 0) > 0 && (
                <button type="button" class="small" disabled={busy} onClick={() => compare(version.version)} title="Replay recorded sessions by this version and by the current one">
                  Compare
                </button>
              )}
              {!aliases.includes(CANDIDATE) && (
                <button type="button" class="small" disabled={busy} onClick={() => nameIt(CANDIDATE, version.version)} title="Sessions can be opened with the alias candidate">
                  Make candidate
                </button>
              )}
              <button type="button" class="small" disabled={busy} onClick={() => use(version.version)} aria-label={`Use version ${count(version.version)}`}>
                Use
              </button>
            </>
          )
        )}
      </td>
    </tr>
  );
}

function aliasesOf(catalogue: Catalogue, version: number): string[] {
  return Object.entries(catalogue.aliases ?? {}).filter(([, named]) => named === version).map(([alias]) => alias);
}

async function currentTag(path: string): Promise<string> {
  return `"${(await getJson<{ revision: number }>(`${path}/current`)).revision}"`;
}
