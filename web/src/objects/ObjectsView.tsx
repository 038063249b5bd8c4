// The gallery: all objects with pictures, a drop zone for meshes, and the training dialog.
import { useEffect, useState } from "preact/hooks";
import { getAll, getJson, ProblemError } from "../api/http";
import { useResource } from "../api/resource";
import type { AppearanceReport, CatalogueVersion, ObjectInfo } from "../api/types";
import { nameColors } from "../colors";
import { percent, plural } from "../format";
import { currentVersions, versionName } from "../models/current";
import { ADD_EXAMPLE, Commands } from "../parts/Commands";
import { Empty, Show } from "../parts/Notes";
import { ViewHead } from "../parts/Panel";
import { link } from "../router";
import { may } from "../signin";
import { DropZone } from "./DropZone";
import { Gallery } from "./Gallery";
import { TrainDialog } from "./TrainDialog";
import { TrainingNow } from "./TrainingNow";

export function ObjectsView() {
  const objects = useResource("objects", (signal) => getAll<ObjectInfo>("/v1/objects", 5000, signal));
  const current = useResource("current versions", currentVersions);
  const twins = useResource(current.data ? `twins ${current.data.map(versionName).join()}` : null, (signal) => nearDuplicates(current.data ?? [], signal));
  const [training, setTraining] = useState(false);
  useEffect(() => {
    if (objects.data) nameColors(objects.data);
  }, [objects.data]);
  const reloadAll = () => {
    objects.reload();
    current.reload();
  };
  const trainable = objects.data?.filter((object) => object.mesh || object.n_readings > 0) ?? [];
  return (
    <>
      <ViewHead title="Objects" sub={objects.data ? `${plural(objects.data.length, "object")}, ${trainable.length} trainable` : "Objects to recognise"}>
        {may("trainer", "admin") && (
          <button type="button" class="primary" disabled={trainable.length === 0} onClick={() => setTraining(true)}>
            Train …
          </button>
        )}
      </ViewHead>
      <TrainingNow onDone={reloadAll} />
      {may("trainer", "admin") && <DropZone onAdded={objects.reload} />}
      {(twins.data ?? []).map((twin) => (
        <div key={`${twin.catalogue} ${twin.first} ${twin.second}`} class="note note-warn" role="note">
          <p class="note-title">{twin.first} and {twin.second} are nearly the same to the touch</p>
          <p>
            Their appearance agrees to {percent(twin.affinity)} in {twin.catalogue} version {twin.version}: is one of them there twice?{" "}
            <a href={link("models", twin.catalogue, twin.version)}>See the report</a>
          </p>
        </div>
      ))}
      <Show of={objects} what="objects" lines={6}>
        {(found) =>
          found.length === 0 ? (
            <Empty title="No objects yet">
              {may("trainer", "admin") && <p>Drop a mesh above, post a robot’s training readings, or add an example:</p>}
              <Commands lines={ADD_EXAMPLE} roles={["trainer", "admin"]} />
            </Empty>
          ) : (
            <Gallery objects={found} versions={current.data} />
          )
        }
      </Show>
      {training && <TrainDialog objects={trainable} onClose={() => setTraining(false)} />}
    </>
  );
}

interface Twins {
  catalogue: string;
  version: number;
  first: string;
  second: string;
  affinity: number;
}

/** Near duplicates in the reports of the current versions. */
async function nearDuplicates(versions: CatalogueVersion[], signal: AbortSignal): Promise<Twins[]> {
  const found: Twins[] = [];
  for (const { catalogue, version, report: { appearance } } of versions) {
    if (!appearance) continue;
    try {
      const path = `/v1/catalogues/${encodeURIComponent(catalogue)}/versions/${version}`;
      const report = await getJson<AppearanceReport>(`${path}/report/appearance`, signal);
      found.push(...report.near_duplicates.map((twin) => ({ ...twin, catalogue, version })));
    } catch (error) {
      // Versions without such a report have no warnings.
      if (!(error instanceof ProblemError) || ![404, 409].includes(error.status)) throw error;
    }
  }
  return found;
}
