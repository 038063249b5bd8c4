// The attention that sessions need, and why.
import { age } from "../format";
import type { TracePoint, Watched } from "./watch";

export type Level = "surprising" | "stuck" | "sure" | "working" | "waiting";

export interface Attention {
  level: Level;
  /** The reason in words. */
  why: string;
}

const SURE = 0.95;
const ORDER: Record<Level, number> = { surprising: 0, stuck: 1, working: 2, waiting: 3, sure: 4 };
/** Time without a reading after which an undecided session is stuck. */
const QUIET_MS = 60_000;
/** Number of readings without progress after which a session is stuck. */
const IDLE_READINGS = 8;

/** State of a session. `now` is this browser's clock. */
export function attention(watched: Watched, now: number): Attention {
  const trace = watched.trace;
  const last = trace.at(-1);
  if (last === undefined || last.nReadings === 0) {
    return { level: "waiting", why: "no reading yet" };
  }
  const surprise = surprising(trace, last);
  if (surprise !== undefined) return { level: "surprising", why: surprise };
  if (last.probability >= SURE) return { level: "sure", why: `${last.best ?? ""} is sure` };
  const quiet = watched.lastReadingAt === undefined ? 0 : now - watched.lastReadingAt;
  if (quiet > QUIET_MS) return { level: "stuck", why: `undecided, no reading for ${age(quiet)}` };
  const before = trace.find((point) => point.nReadings >= last.nReadings - IDLE_READINGS);
  const longEnough = last.nReadings >= IDLE_READINGS && before !== undefined && before.nReadings <= last.nReadings - IDLE_READINGS;
  if (longEnough && last.entropyBits > 0.5 && before.entropyBits - last.entropyBits < 0.1) {
    return { level: "stuck", why: `${IDLE_READINGS} readings without progress` };
  }
  return { level: "working", why: "readings arrive" };
}

function surprising(trace: TracePoint[], last: TracePoint): string | undefined {
  if (last.unknown >= 0.5) return "probably none of the known objects";
  const recent = trace.slice(-5);
  const other = recent.find((point) => point.best !== last.best && point.probability >= 0.7);
  if (other !== undefined) return `answer was ${other.best ?? "another"} shortly before`;
  const previous = trace.at(-2);
  if (previous !== undefined && last.nReadings >= 3 && last.entropyBits - previous.entropyBits >= 0.5) {
    return `the last reading raised the entropy by ${(last.entropyBits - previous.entropyBits).toFixed(1)} bit`;
  }
  return undefined;
}

/** Order: attention first, then less certain, then id, so that rows stay in place. */
export function byAttention(now: number): (a: Watched, b: Watched) => number {
  return (a, b) =>
    ORDER[attention(a, now).level] - ORDER[attention(b, now).level] ||
    Math.round(2 * ((b.trace.at(-1)?.entropyBits ?? 0) - (a.trace.at(-1)?.entropyBits ?? 0))) ||
    a.info.session.id.localeCompare(b.info.session.id);
}
