// Lines of the posterior over identities, from the steps of a session.
import { objectColor, plainColor } from "../colors";
import type { Range, Series } from "../parts/Chart";
import type { Step } from "./model";

/** Maximum number of lines that can be told apart. */
const LINES_MAX = 6;

/** Half of a range about a revision, as far as there are revisions; undefined if it cannot be halved. */
export function closer(range: Range, at: number): Range | undefined {
  const width = (range[1] - range[0]) / 2;
  if (width < 1) return undefined;
  const from = Math.max(range[0], Math.min(range[1] - width, at - width / 2));
  return [from, from + width];
}

/** One line for each object that was ever among the likeliest after a reading, strongest first. */
export function identities(steps: Step[]): Series[] {
  const most = new Map<string, number>();
  for (const step of steps.filter((one) => one.revision > 0)) {
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
