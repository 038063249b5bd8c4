// The likeliest object in its pose, in 3-D, with its touches, and the same as a table.
import { useEffect, useMemo, useState } from "preact/hooks";
import { persist } from "../api/resource";
import type { NextTouch } from "../api/types";
import { colorsVersion, objectColor } from "../colors";
import { dark, degrees, mm, percent, plural, shortId, signedBits } from "../format";
import { Badge, Panel } from "../parts/Panel";
import type { Shape } from "../scene/content";
import type { Stage } from "../scene/stage";
import { Stage3D } from "../scene/Stage3D";
import { contentOf, type Layers } from "./content";
import type { ColorBy, SessionModel } from "./model";
import { savePicture } from "./savePicture";
import { shapeOf } from "./shapes";
import { TouchTable } from "./TouchTable";

interface Props {
  model: SessionModel;
  selected: number | undefined;
  select: (number: number | undefined) => void;
  next: NextTouch[];
}

const LAYERS: [keyof Layers, string][] = [
  ["touches", "Touches"],
  ["faded", "Older ones faint"],
  ["ghosts", "Other hypotheses"],
  ["uncertainty", "Uncertainty"],
  ["untouched", "Not touched"],
  ["truth", "Truth"],
];

export function ScenePanel({ model, selected, select, next }: Props) {
  const [layers, setLayers] = useState<Layers>({ touches: true, faded: true, ghosts: true, uncertainty: false, untouched: false, truth: true });
  const [hovered, setHovered] = useState<number>();
  const [share, setShare] = useState<number>();
  const [stage, setStage] = useState<Stage>();
  const shapes = useShapes(model);
  const belief = model.shown.value;
  const revision = model.shownRevision.value;
  const isStale = model.isStale.value;
  const truth = model.session.value?.truth ?? undefined;
  const readings = model.readings.value;
  const tints = model.tints.value;
  const sensors = model.sensors.value;
  const isDark = dark.value;
  const colors = colorsVersion();
  const content = useMemo(
    () => contentOf({ belief, truth, revision, readings, tints, sensors, shapes, next, layers }),
    [belief, truth, revision, readings, tints, sensors, shapes, next, layers, isDark, colors],
  );
  const isEmpty = belief !== undefined && belief.poses.length === 0 && content.touches.length === 0;
  const best = belief?.poses[0];
  const others = (belief?.poses ?? []).slice(1, 5).filter((pose) => pose.weight >= 0.02);
  const label = best
    ? `${best.name} at ${best.pose.position.map(mm).join(", ")}, ${plural(content.touches.length, "touch", "touches")}, ${plural(others.length, "other hypothesis", "other hypotheses")}`
    : `No pose yet, ${plural(content.touches.length, "touch", "touches")}`;
  const save = () => {
    const likeliest = belief?.objects[0];
    const believed = likeliest ? `${likeliest.name} ${percent(likeliest.probability)}, ` : "";
    void savePicture(stage, `${believed}revision ${revision}, session ${shortId(model.id)}`, `palpate-${shortId(model.id)}-${revision}`);
  };
  return (
    <Panel
      title="Pose"
      class={isStale ? "stale" : ""}
      aside={
        <>
          {isStale && <Badge kind="warn">still revision {revision}</Badge>}
          <button type="button" class="small" disabled={stage === undefined} onClick={save}>Save picture</button>
        </>
      }
    >
      <Stage3D content={content} label={label} selected={selected} onSelect={select} onHover={setHovered} onCovered={setShare}
        onReady={setStage}
        note={`frame ${model.session.value?.frame_id ?? "of the session"} · drag, two fingers or arrow keys rotate · + and −, or Ctrl and the wheel, zoom`}
        {...(isEmpty ? { empty: nothing(model) } : {})} />
      <div class="layers" role="group" aria-label="Layers">
        {LAYERS.filter(([layer]) => layer !== "truth" || truth?.pose).map(([layer, name]) => (
          <button key={layer} type="button" class="small" aria-pressed={layers[layer]} onClick={() => setLayers((before) => ({ ...before, [layer]: !before[layer] }))}>
            {name}
          </button>
        ))}
      </div>
      <Keys model={model} layers={layers} share={share} hasNext={next.length > 0} />
      <p class="touch-say" role="status">{touchWords(model, hovered ?? selected)}</p>
      <TouchTable model={model} selected={selected} select={select} />
    </Panel>
  );
}

/** What colours and shapes mean. */
function Keys({ model, layers, share, hasNext }: { model: SessionModel; layers: Layers; share: number | undefined; hasNext: boolean }) {
  const by = model.coloring.value;
  const truth = model.session.value?.truth;
  const others = (model.shown.value?.poses ?? []).slice(1, 5).filter((pose) => pose.weight >= 0.02);
  return (
    <div class="layers">
      <label class="key">
        Touches by
        <select value={by} onChange={(event) => { model.colorBy.value = event.currentTarget.value as ColorBy; }}>
          <option value="bits">what leaving it out would lose</option>
          <option value="came">what it changed when it came</option>
          <option value="fit">fit with the others</option>
        </select>
      </label>
      <span class="key">
        {by === "fit" ? "unfit" : "against"} <span class="ramp" aria-hidden="true" /> {by === "fit" ? "fits" : "for the answer"}, ±{model.fullAt.value.toFixed(0)} bit
      </span>
      {layers.ghosts && others.map((pose, place) => (
        <span key={place} class="key">
          <span class="dot" style={{ background: objectColor(pose.name) }} aria-hidden="true" />
          {pose.name} {percent(pose.weight)}
        </span>
      ))}
      {hasNext && <span class="key">green arrow: where to touch next</span>}
      {layers.uncertainty && <span class="key">ellipsoid and cones: position and axes of the object, 2 standard deviations</span>}
      {layers.untouched && share !== undefined && (
        <span class="key"><span class="dot dot-untouched" aria-hidden="true" />farther than half a pad from every touch: {percent(1 - share)} of the surface</span>
      )}
      {truth && (
        <span class="key">
          <Badge kind={truth.was_right ? "good" : "bad"} isPast>it was {truth.name ?? "none of the known objects"}</Badge> believed with {percent(truth.probability)}
          {typeof truth.position_error === "number" && typeof truth.angle_error === "number" && `, ${mm(truth.position_error)} and ${degrees(truth.angle_error)} off at its end`}
        </span>
      )}
      {layers.truth && truth?.pose && <span class="key"><span class="dot dot-truth" aria-hidden="true" />net: the object where it truly is</span>}
    </div>
  );
}

/** What is known of a touch. */
function touchWords(model: SessionModel, number: number | undefined): string {
  if (number === undefined) return "Click a touch to see what it says.";
  const one = model.explanation.value?.readings.find((reading) => reading.number === number);
  const height = one?.misfit?.height_m;
  const came = model.came.value.get(number);
  const words = [
    typeof one?.bits === "number" ? `${signedBits(one.bits)} bit lost without it` : "not compared yet",
    ...(typeof came === "number" ? [`${signedBits(came)} bit when it came`] : []),
    ...(typeof one?.fit_bits === "number" ? [`fit ${signedBits(one.fit_bits)} bit`] : []),
    ...(typeof height === "number" ? [`${mm(Math.abs(height))} ${height < 0 ? "below" : "above"} the surface`] : []),
    ...(one?.disagrees ? ["disagrees"] : []),
  ];
  return `Reading ${number + 1}: ${words.join(", ")}.`;
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
  const truth = model.session.value?.truth;
  const trueObject = truth?.pose && truth.object ? [truth.object] : [];
  const believed = (model.shown.value?.poses ?? []).slice(0, 5).map((pose) => pose.object);
  const wanted = [...new Set([...believed, ...trueObject])].sort().join();
  useEffect(() => {
    if (version === undefined) return;
    const abort = new AbortController();
    const objects = wanted.split(",").filter((one) => one !== "");
    setShapes((before) => new Map([...before].filter(([object]) => objects.includes(object))));
    for (const object of objects) {
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
