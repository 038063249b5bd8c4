// One object: its mesh, its training touches, and its trained surface.
import { useMemo, useState } from "preact/hooks";
import { getJson, sendJson } from "../api/http";
import { useResource } from "../api/resource";
import type { CatalogueVersion, InterestMap, MapPatch, ObjectInfo } from "../api/types";
import { objectColor } from "../colors";
import { bytes, classColor, count, dark, plural, symmetryWords, when } from "../format";
import { currentVersions, versionName } from "../models/current";
import { ProblemNote, Show } from "../parts/Notes";
import { Facts, Panel, ViewHead } from "../parts/Panel";
import { Table } from "../parts/Table";
import { useAction } from "../parts/useAction";
import { go, link, useChoice } from "../router";
import { IDENTITY, type Content, type Shape, type SurfacePoint } from "../scene/content";
import { Stage3D } from "../scene/Stage3D";
import type { Vector } from "../scene/vectors";
import { mapOf, meshOf, touchesOf } from "../session/shapes";
import { may } from "../signin";
import { DropZone } from "./DropZone";
import { points, valued } from "./interest";
import { InterestNote } from "./InterestNote";
import { OccupancyPanel } from "./OccupancyPanel";

/** The layer drawn on the surface. */
type Layer = "nothing" | "touches" | "classes" | "interest";

const LAYER_WORDS = { nothing: "nothing", touches: "training touches", classes: "appearance classes", interest: "what a touch tells" };

export function ObjectView({ id }: { id: string }) {
  const object = useResource(`object ${id}`, (signal) => getJson<ObjectInfo>(`/v1/objects/${encodeURIComponent(id)}`, signal));
  return (
    <>
      {!object.data && <ViewHead title={id} />}
      <Show of={object} what="the object" lines={8}>
        {(found) => <Found object={found} reload={object.reload} />}
      </Show>
    </>
  );
}

function Found({ object, reload }: { object: ObjectInfo; reload: () => void }) {
  const versions = useResource(`versions of ${object.id}`, (signal) => knowing(object.id, signal));
  const [chosen, choose] = useChoice("version");
  const version = versions.data?.find((one) => versionName(one) === chosen) ?? versions.data?.[0];
  const action = useAction();
  return (
    <>
      <ViewHead title={<><span class="dot" style={{ background: objectColor(object.name) }} aria-hidden="true" /> {object.name}</>} sub={object.description || (object.n_readings > 0 ? "Taught by touch" : "Taught by its mesh")}>
        {versions.data && versions.data.length > 1 && (
          <select aria-label="Version" value={version ? versionName(version) : ""} onChange={(event) => choose(event.currentTarget.value)}>
            {versions.data.map((one) => (
              <option key={versionName(one)} value={versionName(one)}>{versionName(one)}</option>
            ))}
          </select>
        )}
        {may("trainer", "admin") && (
          <button
            type="button"
            class="danger"
            disabled={action.busy}
            onClick={() => {
              if (confirm(`Delete ${object.name}, its mesh and its touches? Trained versions still recognise it.`)) {
                action.run(async () => {
                  await sendJson("DELETE", `/v1/objects/${object.id}`);
                  go("objects");
                });
              }
            }}
          >
            Delete
          </button>
        )}
      </ViewHead>
      {action.problem && <ProblemNote problem={action.problem} />}
      <div class="session">
        <SurfacePanel object={object} version={version} />
        <div class="stack">
          <AboutPanel object={object} version={version} />
          {version && <OccupancyPanel key={`${versionName(version)} ${object.id}`} version={version} object={object.id} />}
          {may("trainer", "admin") && <DropZone into={object} onAdded={reload} />}
        </div>
      </div>
    </>
  );
}

function SurfacePanel({ object, version }: { object: ObjectInfo; version: CatalogueVersion | undefined }) {
  const [named, setLayer] = useChoice("layer", "touches");
  const layer = named in LAYER_WORDS ? (named as Layer) : "touches";
  const [mesh, setMesh] = useState(true);
  const surface = useResource(`surface of ${object.id} ${object.mesh?.hash} ${version ? versionName(version) : ""}`, () => surfaceOf(object, version));
  const interestPath = version && `/v1/catalogues/${encodeURIComponent(version.catalogue)}/versions/${version.version}/objects/${object.id}/interest`;
  const canTell = (version?.report.surface_bytes ?? 0) > 0;
  const interest = useResource(interestPath !== undefined && canTell && layer === "interest" ? interestPath : null, (signal) => getJson<InterestMap>(interestPath!, signal));
  const data = surface.data;
  const isTold = layer === "interest" && (interest.data?.rivals.length ?? 0) > 0;
  const told = isTold ? interest.data : undefined;
  const isDark = dark.value;
  const content = useMemo((): Content => {
    const bodies = data ? [{ shape: data.shape, pose: IDENTITY, hideMesh: !mesh }] : [];
    const isPainted = mesh && data?.shape.mesh !== undefined;
    const marks = data ? patches(data, layer) : [];
    return {
      bodies, touches: [], approaches: [],
      patches: told && data && !isPainted ? points(told) : marks,
      ...(told && isPainted ? { heat: valued(told) } : {}),
    };
  }, [data, told, layer, mesh, isDark]);
  const nClasses = new Set(data?.map.map((patch) => patch.class)).size;
  return (
    <Panel title="Surface" aside={data && <span>{plural(data.map.length || data.touches.length, "touch", "touches")}</span>}>
      {surface.problem && <ProblemNote problem={surface.problem} retry={surface.reload} />}
      <Stage3D content={content} label={`${object.name}, ${LAYER_WORDS[layer]} over its surface`}
        note="object frame, origin at the centroid · drag, two fingers or arrow keys rotate" />
      <div class="layers" role="group" aria-label="Layers">
        <button type="button" aria-pressed={mesh} disabled={!object.mesh} onClick={() => setMesh(!mesh)}>Mesh</button>
        <button type="button" aria-pressed={layer === "touches"} onClick={() => setLayer(layer === "touches" ? "nothing" : "touches")}>
          Training touches
        </button>
        <button type="button" aria-pressed={layer === "classes"} disabled={!data || data.map.length === 0}
          onClick={() => setLayer(layer === "classes" ? "nothing" : "classes")}>
          Appearance classes
        </button>
        <button type="button" aria-pressed={layer === "interest"} disabled={!canTell}
          onClick={() => setLayer(layer === "interest" ? "nothing" : "interest")}>
          What a touch tells
        </button>
        {layer === "classes" && <span class="key">{plural(nClasses, "class", "classes")} of {version?.report.n_classes} here, each a colour</span>}
      </div>
      {layer === "interest" && <InterestNote of={interest} />}
      {data && data.map.length > 0 && <ClassTable patches={data.map} />}
    </Panel>
  );
}

function ClassTable({ patches }: { patches: MapPatch[] }) {
  const counts = new Map<number | null, number>();
  for (const patch of patches) counts.set(patch.class ?? null, (counts.get(patch.class ?? null) ?? 0) + 1);
  const rows = [...counts].sort((a, b) => b[1] - a[1]);
  return (
    <details class="behind">
      <summary>Classes as a table</summary>
      <Table label="Appearance classes" columns={["Class", ["Touches", "num"]]}>
        {rows.map(([one, n]) => (
          <tr key={String(one)}>
            <th scope="row"><span class="key"><span class="dot" style={{ background: classColor(one) }} />{one === null ? "in no pair" : one}</span></th>
            <td class="num">{n}</td>
          </tr>
        ))}
      </Table>
    </details>
  );
}

function AboutPanel({ object, version }: { object: ObjectInfo; version: CatalogueVersion | undefined }) {
  const trained = version?.report.objects.find((one) => one.id === object.id);
  return (
    <Panel title="About">
      <Facts
        of={[
          ["Mesh", object.mesh ? `${object.mesh.format.toUpperCase()} in ${object.mesh.unit}, ${bytes(object.mesh.bytes)}` : "none"],
          ["Robot’s touches", count(object.n_readings)],
          ["Added", when(object.created_at)],
          ["Trained in", version ? <a key="version" href={link("models", version.catalogue, version.version)}>{versionName(version)}</a> : "no current version"],
          ...(trained
            ? ([
                ["Touches learnt", count(trained.n_readings)],
                ["Symmetry", symmetryWords(trained)],
              ] as [string, string][])
            : []),
        ]}
      />
    </Panel>
  );
}

interface Surface {
  shape: Shape;
  map: MapPatch[];
  touches: SurfacePoint[];
}

async function surfaceOf(object: ObjectInfo, version: CatalogueVersion | undefined): Promise<Surface> {
  const trained = version?.report.objects.find((one) => one.id === object.id);
  const origin = (trained?.origin_in_mesh ?? [0, 0, 0]) as Vector;
  const map = version && trained && trained.n_patches > 0 ? (await mapOf(version, object.id)).all : [];
  const touches = map.length === 0 && object.n_readings > 0 ? await touchesOf(object, origin) : [];
  const id = `object/${object.id}/${object.mesh?.hash ?? ""}/${object.mesh?.unit ?? ""}/${origin.join()}`;
  const shape = object.mesh ? await meshOf(object, origin, id) : { id, points: [] };
  return { shape, map, touches };
}

function patches({ map, touches }: Surface, layer: Layer): SurfacePoint[] {
  if (layer === "nothing" || layer === "interest") return [];
  const plain = dark.value ? "#53c1de" : "#0b6e8a";
  if (map.length === 0) return touches.map((touch) => ({ ...touch, color: plain }));
  return map.map((patch) => ({
    position: patch.position as Vector,
    normal: patch.normal as Vector,
    color: layer === "classes" ? classColor(patch.class) : plain,
  }));
}

/** Current versions that include an object. */
async function knowing(object: string, signal: AbortSignal): Promise<CatalogueVersion[]> {
  return (await currentVersions(signal)).filter((version) => version.report.objects.some((one) => one.id === object));
}
