// Answer, truth and labels of a session as text.
import type { Session, TracePoint } from "../api/types";
import { NONE_OF_THESE } from "../belief";
import { percent } from "../format";

/** The likeliest answer of the newest belief; undefined before the first. */
export function answerOf(session: Session): { name: string; probability: number } | undefined {
  return session.latest ? likeliest(session.latest) : undefined;
}

/** The likeliest answer of a belief in short. */
export function likeliest({ best, unknown }: Pick<TracePoint, "best" | "unknown">): { name: string; probability: number } {
  return best && best.probability >= unknown ? { name: best.name, probability: best.probability } : { name: NONE_OF_THESE, probability: unknown };
}

/** The answer and its probability: `mug, 99.2 %`. */
export function answerWords(session: Session): string {
  const answer = answerOf(session);
  return answer ? `${answer.name}, ${percent(answer.probability)}` : "–";
}

export function truthName(session: Session): string | undefined {
  return session.truth ? (session.truth.name ?? NONE_OF_THESE) : undefined;
}

/** Labels as people write them: `site=oslo, shift=night`. */
export function labelWords(labels: Record<string, string> | undefined): string {
  return Object.entries(labels ?? {}).map(([key, value]) => `${key}=${value}`).join(", ");
}

/** Labels of a text; undefined if a part has no key. */
export function labelsOf(text: string): Record<string, string> | undefined {
  const parts = text.split(",").map((part) => part.trim()).filter((part) => part !== "");
  const pairs = parts.map((part): [string, string] => {
    const at = part.indexOf("=");
    return at < 0 ? [part, ""] : [part.slice(0, at).trim(), part.slice(at + 1).trim()];
  });
  return pairs.some(([key]) => key === "") ? undefined : Object.fromEntries(pairs);
}
