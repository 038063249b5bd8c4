// Report of one version: its objects, and which of them touch confuses.
import { getJson } from "../api/http";
import { useResource } from "../api/resource";
import type { AppearanceReport, CatalogueVersion } from "../api/types";
import { bytes, count, duration, percent, plural, symmetryWords, when } from "../format";
import { descriptorWords } from "../words";
import { Matrix } from "../parts/Matrix";
import { Show } from "../parts/Notes";
import { Badge, Facts, Panel, ViewHead } from "../parts/Panel";
import { Table } from "../parts/Table";
import { link } from "../router";

export function VersionView({ catalogue, version }: { catalogue: string; version: string }) {
  const path = `/v1/catalogues/${encodeURIComponent(catalogue)}/versions/${encodeURIComponent(version)}`;
  const found = useResource(path, (signal) => getJson<CatalogueVersion>(path, signal));
  return (
    <>
      <ViewHead title={`${catalogue} version ${version}`} sub={found.data ? `Trained ${when(found.data.created_at)}` : "Trained version"}>
        {found.data?.is_current && <Badge kind="current">current</Badge>}
        {found.data?.damage && <Badge kind="bad">damaged</Badge>}
      </ViewHead>
      <Show of={found} what="the version" lines={8}>
        {(data) => (
          <>
            {data.damage && <p class="note note-bad">{data.damage}</p>}
            <Summary version={data} />
            <Objects version={data} />
            <Appearance version={data} path={path} />
          </>
        )}
      </Show>
    </>
  );
}

function Summary({ version }: { version: CatalogueVersion }) {
  const { report, training } = version;
  return (
    <Panel title="How it was trained">
      <Facts
        of={[
          ["Took", duration(report.seconds)],
          ["Objects", count(report.objects.length)],
          ["Touches per object, for pairs", training.readings_per_object ? count(training.readings_per_object) : "–"],
          ["Touches per object, for its surface", training.surface_readings_per_object ? count(training.surface_readings_per_object) : "–"],
          ...(report.n_classes > 0
            ? ([
                ["Kinds of touch images told apart", count(report.n_classes)],
                ["Images are compared", training.descriptor ? descriptorWords(training.descriptor) : "–"],
                ["Index of pairs of touches", bytes(report.index_bytes)],
              ] as [string, string][])
            : []),
          ["Learnt surfaces", (report.surface_bytes ?? 0) > 0 ? bytes(report.surface_bytes ?? 0) : "none"],
          ["Seed of the random numbers", String(report.seed)],
        ]}
      />
    </Panel>
  );
}

function Objects({ version }: { version: CatalogueVersion }) {
  return (
    <Panel title="Objects">
      <Table label="Objects of the version" columns={["Object", ["Touches", "num"], ["Places learnt", "num"], ["Pairs of places", "num"], "Symmetry", "Contact map"]}>
        {version.report.objects.map((object) => (
          <tr key={object.id}>
            <th scope="row"><a href={link("objects", object.id)}>{object.name}</a></th>
            <td class="num">{count(object.n_readings)}</td>
            <td class="num">{count(object.n_patches)}</td>
            <td class="num">{object.surface ? count(object.surface.n_pairs) : "–"}</td>
            <td>{symmetryWords(object)}</td>
            <td class="tight">{object.geometric ? `${object.geometric.kind}, ${object.geometric.n_cells.join(" × ")}` : "none"}</td>
          </tr>
        ))}
      </Table>
    </Panel>
  );
}

function Appearance({ version, path }: { version: CatalogueVersion; path: string }) {
  const has = Boolean(version.report.appearance);
  const report = useResource(has ? `${path}/report/appearance` : null, (signal) => getJson<AppearanceReport>(`${path}/report/appearance`, signal));
  if (!has) {
    return (
      <Panel title="Confusable objects">
        <p class="faint">This version was trained without appearance. Train with appearance to see confusion, similarity and near duplicates.</p>
      </Panel>
    );
  }
  return (
    <Panel title="Confusable objects" aside={report.data && `by appearance alone, after ${plural(report.data.n_readings, "reading")} each`}>
      <Show of={report} what="the report" lines={6}>
        {(found) => <Report report={found} />}
      </Show>
    </Panel>
  );
}

function Report({ report }: { report: AppearanceReport }) {
  const names = report.objects.map((object) => object.name);
  return (
    <div class="stack">
      {report.warnings.map((warning) => (
        <p key={warning} class="note note-warn">{warning}</p>
      ))}
      {report.near_duplicates.length === 0 && report.warnings.length === 0 && (
        <p class="note note-good">No near duplicates.</p>
      )}
      <Facts
        of={[
          ["Recognised", percent(report.accuracy)],
          ["Kinds of touch images", count(report.n_classes)],
          ["Numbers that describe an image", `${report.feature_length}, reduced to ${report.n_components}`],
        ]}
      />
      <div class="grid grid-2 matrices">
        <Matrix caption="Confusion: mean probability of each object (column) when the row’s object was touched" names={names} rows={report.confusion} rowWord="touched" diagonalIsGood />
        <Matrix caption="Similarity of the objects’ appearance histograms" names={names} rows={report.affinity} rowWord="object" diagonalIsGood />
      </div>
    </div>
  );
}
