// The likeliest object in its pose, in 3-D, with its touches, and the same as a table.
import { useEffect, useMemo, useState } from "preact/hooks";
import { persist } from "../api/resource";
import type { NextTouch } from "../api/types";
import { colorsVersion, objectColor } from "../colors";
import { dark, mm, percent, signedBits } from "../format";
import { Badge, Panel } from "../parts/Panel";
import type { Shape } from "../scene/content";
import { Stage3D } from "../scene/Stage3D";
import { contentOf, counts } from "./content";
import type { ColorBy, SessionModel } from "./model";
import { shapeOf } from "./shapes";

export function ScenePanel(props: { model: SessionModel; selected: number | undefined; next: NextTouch[] }) {
  const { model, selected, next } = props;
  const [ghosts, setGhosts] = useState(true);
  const shapes = useShapes(model);
  const belief = model.shown.value;
  const revision = model.shownRevision.value;
  const isStale = model.isStale.value;
  const readings = model.readings.value;
  const tints = model.tints.value;
  const by = model.coloring.value;
  const sensors = model.sensors.value;
  const isDark = dark.value;
  const colors = colorsVersion();
  const content = useMemo(
    () => contentOf({ belief, revision, readings, tints, sensors, shapes, selected, next, ghosts }),
    [belief, revision, readings, tints, sensors, shapes, selected, next, ghosts, isDark, colors],
  );
  const isEmpty = belief !== undefined && belief.poses.length === 0 && content.touches.length === 0;
  const best = belief?.poses[0];
  const others = (belief?.poses ?? []).slice(1, 5).filter((pose) => pose.weight >= 0.02);
  const label = best
    ? `${best.name} at ${best.pose.position.map(mm).join(", ")}, ${content.touches.length} touches, ${others.length} other hypotheses`
    : `No pose yet, ${content.touches.length} touches`;
  return (
    <Panel
      title="Pose"
      class={isStale ? "stale" : ""}
      aside={
        <>
          {isStale && <Badge kind="warn">still revision {revision}</Badge>}
          <button type="button" class="small" aria-pressed={ghosts} onClick={() => setGhosts(!ghosts)}>
            Other hypotheses
          </button>
        </>
      }
    >
      <Stage3D content={content} label={label} note={`frame ${model.session.value?.frame_id ?? "of the session"} · drag or arrow keys rotate, + and − zoom`}
        {...(isEmpty ? { empty: nothing(model) } : {})} />
      <div class="layers">
        <label class="key">
          Touches by
          <select value={by} onChange={(event) => (model.colorBy.value = event.currentTarget.value as ColorBy)}>
            <option value="bits">bits contributed</option>
            <option value="fit">fit with the others</option>
          </select>
        </label>
        <span class="key">
          {by === "bits" ? "against" : "unfit"} <span class="ramp" aria-hidden="true" /> {by === "bits" ? "for the answer, ±4 bit" : "fits, ±16 bit"}
        </span>
        {others.map((pose, place) => (
          <span key={place} class="key">
            <span class="dot" style={{ background: objectColor(pose.name) }} aria-hidden="true" />
            {pose.name} {percent(pose.weight)}
          </span>
        ))}
        {next.length > 0 && <span class="key">green arrow: where to touch next</span>}
      </div>
      <TouchTable model={model} />
    </Panel>
  );
}

/** Why the scene is empty. */
function nothing(model: SessionModel): string {
  if (model.revision.value === 0) return "No touches yet.";
  const isAppearance = model.session.value?.method.startsWith("appearance");
  return isAppearance ? "This method recognises the object but not its pose." : "No pose yet.";
}

/** Shapes of the hypotheses' objects, as they load. */
function useShapes(model: SessionModel): Map<string, Shape> {
  const [shapes, setShapes] = useState(new Map<string, Shape>());
  const version = model.version.value;
  const wanted = [...new Set((model.shown.value?.poses ?? []).slice(0, 5).map((pose) => pose.object))].sort().join();
  useEffect(() => {
    if (version === undefined) return;
    const abort = new AbortController();
    for (const object of wanted.split(",").filter((one) => one !== "")) {
      persist(() => shapeOf(version, object), abort.signal).then(
        (shape) => setShapes((before) => (before.get(object) === shape ? before : new Map(before).set(object, shape))),
        () => {
          // Without a shape, only the touches are drawn.
        },
      );
    }
    return () => abort.abort();
  }, [version, wanted]);
  return shapes;
}

function TouchTable({ model }: { model: SessionModel }) {
  const revision = model.shownRevision.value;
  const contributed = new Map(model.explanation.value?.readings.map((one) => [one.number, one.bits]));
  const touched = model.readings.value.filter((reading) => reading.pose && counts(reading, revision));
  return (
    <details class="behind">
      <summary>Touches as a table</summary>
      <div class="scroll" tabIndex={0} role="region" aria-label="Touches">
        <table>
          <thead>
            <tr>
              <th scope="col">Reading</th>
              <th scope="col">Position (mm)</th>
              <th scope="col">Sensor direction</th>
              <th scope="col" class="num">Bits</th>
            </tr>
          </thead>
          <tbody>
            {touched.map((reading) => (
              <tr key={reading.number}>
                <th scope="row">{reading.number + 1}</th>
                <td class="num-left">{reading.pose!.position.map((part) => (part * 1000).toFixed(1)).join(", ")}</td>
                <td>{direction(reading.pose!.orientation)}</td>
                <td class="num">{signedBits(contributed.get(reading.number))}</td>
              </tr>
            ))}
          </tbody>
        </table>
      </div>
    </details>
  );
}

function direction(q: number[]): string {
  const [x = 0, y = 0, z = 0, w = 1] = q;
  const along = [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)];
  return along.map((part) => part.toFixed(2)).join(", ");
}
