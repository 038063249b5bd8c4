// Whether the server answers: one state for every word on the page, from all requests, streams and probes.
import { computed, effect, signal } from "@preact/signals";
import { now } from "../format";

/** Silence after which the server is probed, on every page. */
const PROBE_AFTER_MS = 4000;
/** A request that has waited this long, while nothing was heard, is reason to probe. */
const ASKED_MS = 1000;
/** A probe without an answer for this long: the server is silent. It is the shortest work there is. */
const PROBE_MS = 800;
const PROBE_TIMEOUT_MS = 5000;
/** A stream's keep-alives arrive every 15 s; a third of that is slack. */
export const STREAM_SILENT_MS = 20_000;

/** An open stream, and when its last bytes arrived. */
export interface Line {
  heardAt: number;
}

let heardAt = Date.now();
let isProbing = false;
/** When the server was last heard, while nothing answers. */
const unanswered = signal<number | undefined>(undefined);
const lines = signal<readonly Line[]>([]);

/** When the page last heard what it follows; undefined while it hears it. Old values are shown with this age. */
export const silentSince = computed<number | undefined>(() => {
  const lost = lines.value.map((line) => line.heardAt).filter((at) => now.value - at >= STREAM_SILENT_MS);
  const since = Math.min(unanswered.value ?? Infinity, ...lost);
  return Number.isFinite(since) ? since : undefined;
});

/** Whether a stream is open and heard. */
export const isLive = computed(() => silentSince.value === undefined && lines.value.length > 0);

/** Notes that the server was heard. */
export function heard(): void {
  heardAt = Date.now();
  unanswered.value = undefined;
}

/** Notes that what began at a time was not answered; news since then are stronger. */
export function missed(begun: number): void {
  if (heardAt <= begun) unanswered.value ??= heardAt;
}

/** Notes that a request begins; call the result when it ends. */
export function asking(): () => void {
  const begun = Date.now();
  const timer = setTimeout(() => {
    if (heardAt <= begun) void probe();
  }, ASKED_MS);
  return () => clearTimeout(timer);
}

/** Notes that a stream is open. */
export function opened(): Line {
  const line = { heardAt: Date.now() };
  lines.value = [...lines.value, line];
  return line;
}

/** Notes that a stream has ended. */
export function closed(line: Line): void {
  lines.value = lines.value.filter((one) => one !== line);
}

async function probe(): Promise<void> {
  if (isProbing) return;
  isProbing = true;
  const begun = Date.now();
  const late = setTimeout(() => missed(begun), PROBE_MS);
  try {
    const answer = await fetch("/livez", { cache: "no-store", signal: AbortSignal.timeout(PROBE_TIMEOUT_MS) });
    if (answer.ok) heard();
    else missed(begun);
  } catch {
    missed(begun);
  } finally {
    clearTimeout(late);
    isProbing = false;
  }
}

effect(() => {
  if (now.value - heardAt < PROBE_AFTER_MS || document.hidden) return;
  void probe();
});
