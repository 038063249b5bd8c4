// What is believed, in a few words: the titles of rows, pages and tabs.
import { percent } from "./format";

/** Name of an object that the catalogue does not have. */
export const NONE_OF_THESE = "none of these";

/** The likeliest answer of a belief, which may be "none of these". */
export interface Answer {
  name: string;
  probability: number;
  isUnknown: boolean;
}

/** The likeliest answer; undefined before the first reading. */
export function answerOf(
  belief: { objects: { name: string; probability: number }[]; unknown?: number | null | undefined } | null | undefined,
  nReadings: number,
): Answer | undefined {
  if (!belief || nReadings === 0) return undefined;
  const best = belief.objects.reduce<{ name: string; probability: number } | undefined>(
    (most, one) => (most === undefined || one.probability > most.probability ? one : most),
    undefined,
  );
  const unknown = belief.unknown ?? 0;
  if (best === undefined || unknown > best.probability) {
    return unknown > 0 ? { name: NONE_OF_THESE, probability: unknown, isUnknown: true } : undefined;
  }
  return { name: best.name, probability: best.probability, isUnknown: false };
}

/** `hammer, >99.9 % — arm-3`. */
export function titleOf(answer: Answer | undefined, whose: string): string {
  const believed = answer === undefined ? "nothing felt yet" : `${answer.name}, ${percent(answer.probability)}`;
  return `${believed} — ${whose}`;
}
