// Posterior over identities and entropy, by revision.
import { useMemo } from "preact/hooks";
import { colorsVersion, objectColor, plainColor } from "../colors";
import { dark, percent } from "../format";
import { Chart, type Series } from "../parts/Chart";
import { Panel } from "../parts/Panel";
import type { SessionModel, Step } from "./model";

/** Maximum number of lines that can be told apart. */
const LINES_MAX = 6;

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

/** One line for each object that was ever among the likeliest, strongest first. */
function identities(steps: Step[]): Series[] {
  const most = new Map<string, number>();
  for (const step of steps) {
    for (const { name, probability } of step.objects) {
      most.set(name, Math.max(most.get(name) ?? 0, probability));
    }
  }
  const last = new Map(steps.at(-1)?.objects.map(({ name, probability }) => [name, probability]));
  const names = [...most.keys()]
    .sort((a, b) => (last.get(b) ?? 0) - (last.get(a) ?? 0) || most.get(b)! - most.get(a)!)
    .slice(0, LINES_MAX);
  const lines = names.map((name): Series => ({
    label: name,
    color: objectColor(name),
    values: steps.map((step) => step.objects.find((one) => one.name === name)?.probability ?? 0),
  }));
  if (steps.some((step) => step.unknown > 0)) {
    lines.push({ label: "none of these", color: plainColor(), values: steps.map((step) => step.unknown), dashed: true });
  }
  return lines;
}
