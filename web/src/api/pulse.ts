// Whether the server answers: when it was last heard, by any request, stream or probe.
import { effect, signal } from "@preact/signals";
import { now } from "../format";

/** Silence after which the server is probed. */
const PROBE_AFTER_MS = 4000;
/** Silence after which nothing on the page counts as live. */
export const SILENT_MS = 8000;
/** A stream's keep-alives arrive every 15 s; a third of that is slack. */
export const STREAM_SILENT_MS = 20_000;
const PROBE_TIMEOUT_MS = 5000;

let heardAt = Date.now();
let isProbing = false;

/** Notes that the server was heard. */
export function heard(): void {
  heardAt = Date.now();
}

/** Milliseconds since the server was heard. */
export function silence(at: number): number {
  return Math.max(0, at - heardAt);
}

async function probe(): Promise<void> {
  if (isProbing) return;
  isProbing = true;
  try {
    const answer = await fetch("/livez", { cache: "no-store", signal: AbortSignal.timeout(PROBE_TIMEOUT_MS) });
    if (answer.ok) heard();
  } catch {
    // The silence goes on.
  } finally {
    isProbing = false;
  }
}

/** Number of views that show whether they are live; without one, nothing is probed. */
const watching = signal(0);

/** Keeps the silence known while a view shows it. */
export function watchPulse(): () => void {
  watching.value += 1;
  return () => {
    watching.value -= 1;
  };
}

effect(() => {
  if (watching.value === 0 || document.hidden) return;
  if (now.value - heardAt >= PROBE_AFTER_MS) void probe();
});

/** A stream as seen by its reader: open, and when its last bytes arrived. */
export interface Line {
  open: boolean;
  heardAt: number;
}

export const NO_LINE: Line = { open: false, heardAt: 0 };

/** How long the view has heard nothing, in milliseconds; 0 while it is live. */
export function silentFor(line: Line, at: number): number {
  if (silence(at) >= SILENT_MS) return silence(at);
  const streamSilence = line.open ? at - line.heardAt : 0;
  return streamSilence >= STREAM_SILENT_MS ? streamSilence : 0;
}
