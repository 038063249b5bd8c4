// The contact map of an object: a heat map of a plane, or slices of a solid.
import { useEffect, useState } from "preact/hooks";
import { ask, getJson } from "../api/http";
import { useResource } from "../api/resource";
import type { CatalogueVersion, OccupancyMap } from "../api/types";
import { count, mm } from "../format";
import { ProblemNote, Show } from "../parts/Notes";
import { Facts, Panel } from "../parts/Panel";

export function OccupancyPanel({ version, object }: { version: CatalogueVersion; object: string }) {
  const trained = version.report.objects.find((one) => one.id === object);
  const path = `/v1/catalogues/${encodeURIComponent(version.catalogue)}/versions/${version.version}/objects/${object}/occupancy`;
  const map = useResource(trained?.geometric ? path : null, (signal) => getJson<OccupancyMap>(path, signal));
  if (!trained?.geometric) {
    return (
      <Panel title="Contact map">
        <p class="faint">
          {version.catalogue} version {version.version} was trained without contact maps. Train with “planar” for raised shapes
          that are pressed from above, with “solid” for things touched from all sides.
        </p>
      </Panel>
    );
  }
  return (
    <Panel title="Contact map">
      <Show of={map} what="the map" lines={6}>
        {(found) => <MapView map={found} path={path} />}
      </Show>
    </Panel>
  );
}

function MapView({ map, path }: { map: OccupancyMap; path: string }) {
  const layers = map.n_cells[2] ?? 1;
  const [slice, setSlice] = useState(Math.floor(layers / 2));
  const [picture, setPicture] = useState<string>();
  const image = useResource(`${path}.png?slice=${slice}`, async (signal) => (await ask(`${path}.png?slice=${slice}`, { signal })).blob());
  useEffect(() => {
    if (image.data === undefined) return;
    const url = URL.createObjectURL(image.data);
    setPicture(url);
    return () => URL.revokeObjectURL(url);
  }, [image.data]);
  const height = (map.min[2] ?? 0) + (slice + 0.5) * map.cell;
  const what = layers > 1 ? `Slice ${slice + 1} of ${layers}, at z = ${mm(height)}` : "The plane";
  return (
    <div class="stack">
      {image.problem && <ProblemNote problem={image.problem} />}
      {/* The slice before stays until the next one has come. */}
      {picture ? <img class="heatmap" src={picture} alt={`${what}: blue is free, grey unknown, red occupied; x to the right, y up`} /> : <div class="heatmap" />}
      {layers > 1 && (
        <div class="field">
          <label for="slice">{what}</label>
          <input id="slice" type="range" min={0} max={layers - 1} value={slice} aria-valuetext={what}
            onInput={(event) => setSlice(Number(event.currentTarget.value))} />
        </div>
      )}
      <p class="faint">Blue is free, grey unknown, red occupied; x to the right, y up.</p>
      <Facts
        of={[
          ["Cells", `${map.n_cells.join(" × ")} of ${mm(map.cell)}`],
          ["Occupied", count(map.n_occupied)],
          ["Free", count(map.n_free)],
          ["Unknown", count(map.n_unknown)],
        ]}
      />
    </div>
  );
}
