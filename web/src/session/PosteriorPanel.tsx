// Posterior over identities and entropy, by revision, from the prior on.
import { useMemo, useState } from "preact/hooks";
import { colorsVersion, plainColor } from "../colors";
import { dark, percent } from "../format";
import { Chart, LOW, type Range, type Series } from "../parts/Chart";
import { Panel } from "../parts/Panel";
import { fromPrior, type SessionModel } from "./model";
import { closer, identities } from "./posterior";

export function PosteriorPanel({ model }: { model: SessionModel }) {
  const [zoom, setZoom] = useState<Range>();
  const known = model.steps.value;
  const prior = model.prior.value;
  const steps = useMemo(() => fromPrior(prior, known), [prior, known]);
  const isDark = dark.value;
  const x = useMemo(() => steps.map((step) => step.revision), [steps]);
  const colors = colorsVersion();
  const posterior = useMemo(() => identities(steps), [steps, isDark, colors]);
  const entropy = useMemo(
    (): Series[] => [{ label: "uncertainty over the objects", color: plainColor(), values: steps.map((step) => step.entropyBits) }],
    [steps, isDark],
  );
  const at = model.revision.value;
  const pick = (revision: number) => void model.show(revision);
  if (known.length === 0) {
    return (
      <Panel title="Posterior over readings" class="panel-posterior">
        <div class="chart-plot chart-none faint">No readings yet.</div>
      </Panel>
    );
  }
  const half = closer(zoom ?? [x[0] ?? 0, x.at(-1) ?? 0], at);
  const shared = { xLabel: "Revision (number)", wholeX: true, x, at, onPick: pick, zoom, onZoom: setZoom };
  return (
    <Panel
      title="Posterior over readings"
      class="panel-posterior"
      aside={
        <>
          <button type="button" class="small" disabled={half === undefined} onClick={() => setZoom(half)}>Zoom in</button>
          <button type="button" class="small" disabled={zoom === undefined} onClick={() => setZoom(undefined)}>All revisions</button>
        </>
      }
    >
      <Chart label="Probability of each object after each revision" yLabel="Probability (%)" series={posterior} range={[0, 1.02]} format={percent}
        tick={(p) => String(Math.round(p * 100))} {...shared} />
      <Chart label="Uncertainty in bits after each revision" yLabel="Uncertainty (bit)" series={entropy} height={LOW} fromZero format={(value) => value.toFixed(2)}
        tick={(value) => String(Number(value.toFixed(3)))} {...shared} />
    </Panel>
  );
}
