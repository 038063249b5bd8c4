// Posterior over identities and entropy, by revision.
import { useMemo } from "preact/hooks";
import { colorsVersion, plainColor } from "../colors";
import { dark, percent } from "../format";
import { Chart, type Series } from "../parts/Chart";
import { Panel } from "../parts/Panel";
import type { SessionModel } from "./model";
import { identities } from "./posterior";

export function PosteriorPanel({ model }: { model: SessionModel }) {
  const steps = model.steps.value;
  const isDark = dark.value;
  const x = useMemo(() => steps.map((step) => step.revision), [steps]);
  const colors = colorsVersion();
  const posterior = useMemo(() => identities(steps), [steps, isDark, colors]);
  const entropy = useMemo(
    (): Series[] => [{ label: "uncertainty (bit)", color: plainColor(), values: steps.map((step) => step.entropyBits) }],
    [steps, isDark],
  );
  const pick = (revision: number) => void model.show(revision);
  if (steps.length === 0) {
    return (
      <Panel title="Posterior over readings" class="panel-posterior">
        <div class="chart-plot chart-none faint">No readings yet.</div>
      </Panel>
    );
  }
  return (
    <Panel title="Posterior over readings" class="panel-posterior">
      <Chart label="Probability of each object after each revision" xLabel="Revision" wholeX x={x} series={posterior} range={[0, 1.02]}
        format={percent} tick={(p) => `${Math.round(p * 100)} %`} at={model.revision.value} onPick={pick} />
      <Chart label="Uncertainty in bits after each revision" xLabel="Revision" wholeX x={x} series={entropy} height={140}
        format={(value) => value.toFixed(1)} at={model.revision.value} onPick={pick} />
    </Panel>
  );
}
