// State of the open sessions: listed every few seconds, and followed by one event stream.
import { signal } from "@preact/signals";
import { follow } from "../api/events";
import { getJson } from "../api/http";
import { NO_LINE, type Line } from "../api/pulse";
import { problemFrom } from "../api/resource";
import type { Belief, Fleet, FleetSession, Problem, Replay, SessionEvent } from "../api/types";

/** State of an open session. */
export interface Watched {
  info: FleetSession;
  belief: Belief | undefined;
  /** Beliefs over the readings, oldest first. */
  trace: TracePoint[];
  /** When its newest reading arrived, by this browser's clock. */
  lastReadingAt: number | undefined;
}

export interface TracePoint {
  revision: number;
  nReadings: number;
  entropyBits: number;
  best: string | undefined;
  probability: number;
  unknown: number;
}

export interface FleetState {
  sessions: Watched[];
  nOpen: number;
  loaded: boolean;
  line: Line;
  problem: Problem | undefined;
}

const LIST_EVERY_MS = 3000;
const LIST_TIMEOUT_MS = 10_000;
/** Maximum wait of the first list for histories. */
const SETTLE_MS = 1500;
/** Sessions with more revisions than this start their trace now. */
const REPLAY_MAX = 120;

export const fleet = signal<FleetState>({
  sessions: [],
  nOpen: 0,
  loaded: false,
  line: NO_LINE,
  problem: undefined,
});

/** Starts watching; the returned function stops it. */
export function watchFleet(): () => void {
  const whole = new AbortController();
  let stream = new AbortController();
  let followed = "";
  /** Offset of this browser's clock from the server's. */
  let clockAhead = 0;
  const asked = new Set<string>();

  let isListing = false;
  const list = async () => {
    if (isListing) return;
    isListing = true;
    try {
      const found = await getJson<Fleet>("/v1/fleet", whole.signal, LIST_TIMEOUT_MS);
      isListing = false;
      clockAhead = Date.now() - Date.parse(found.at);
      merge(found, clockAhead);
      const ids = found.sessions.map((one) => one.session.id).sort();
      const isNew = ids.join() !== followed;
      if (isNew) restart(ids);
      if (fleet.value.loaded) return void (isNew && history(ids));
      // The first list waits for the histories, so that its order is stable.
      await Promise.race([history(ids), new Promise((resolve) => setTimeout(resolve, SETTLE_MS))]);
      fleet.value = { ...fleet.value, loaded: true };
    } catch (error) {
      if (!whole.signal.aborted) fleet.value = { ...fleet.value, loaded: true, problem: problemFrom(error) };
    } finally {
      isListing = false;
    }
  };

  const restart = (ids: string[]) => {
    stream.abort();
    stream = new AbortController();
    followed = ids.join();
    if (ids.length === 0) return;
    const path = `/v1/events?sessions=${ids.map(encodeURIComponent).join(",")}`;
    follow(path, stream.signal, (event) => take(JSON.parse(event.data) as SessionEvent), (line) => {
      fleet.value = { ...fleet.value, line };
    }).catch(() => {
      // The session is gone; the next list omits it.
      followed = "";
      fleet.value = { ...fleet.value, line: NO_LINE };
    });
  };

  const history = async (ids: string[]) => {
    for (const id of ids.filter((one) => !asked.has(one))) {
      asked.add(id);
      const revision = find(id)?.info.session.revision ?? 0;
      if (revision === 0 || revision > REPLAY_MAX || whole.signal.aborted) continue;
      try {
        const path = `/v1/sessions/${id}/replay?limit=${REPLAY_MAX}&poses=0`;
        remember(id, await getJson<Replay>(path, whole.signal));
      } catch {
        // Without its history the session is still listed; the next list requests it again.
        asked.delete(id);
      }
    }
  };

  fleet.value = { ...fleet.value, loaded: false, line: NO_LINE };
  void list();
  const timer = setInterval(() => {
    if (!document.hidden) void list();
  }, LIST_EVERY_MS);
  return () => {
    clearInterval(timer);
    whole.abort();
    stream.abort();
  };
}

function find(id: string): Watched | undefined {
  return fleet.value.sessions.find((one) => one.info.session.id === id);
}

function merge(found: Fleet, clockAhead: number): void {
  const sessions = found.sessions.map((info): Watched => {
    const known = find(info.session.id);
    const last = info.last_reading_at;
    const lastReadingAt = last ? Date.parse(last) + clockAhead : undefined;
    return { belief: known?.belief, trace: known?.trace ?? [], info, lastReadingAt };
  });
  fleet.value = { ...fleet.value, sessions, nOpen: found.n_open, problem: undefined };
}

function change(id: string, how: (watched: Watched) => Watched | undefined): void {
  const sessions = fleet.value.sessions.flatMap((one) => {
    const changed = one.info.session.id === id ? how(one) : one;
    return changed === undefined ? [] : [changed];
  });
  fleet.value = { ...fleet.value, sessions };
}

function take(event: SessionEvent): void {
  if (event.kind === "belief") {
    const { belief } = event;
    change(belief.session, (one) => {
      const grew = one.belief !== undefined && belief.n_readings > one.belief.n_readings;
      return {
        ...one,
        belief,
        trace: joined(one.trace, [pointOf(belief)]),
        lastReadingAt: grew ? Date.now() : one.lastReadingAt,
      };
    });
  } else {
    const id = event.kind === "closed" ? event.session.id : event.session;
    change(id, () => undefined);
  }
}

function remember(id: string, replay: Replay): void {
  const points = replay.steps.map((step): TracePoint => ({
    revision: step.revision,
    nReadings: step.n_readings,
    entropyBits: step.entropy_bits,
    best: step.best?.name,
    probability: step.best?.probability ?? 0,
    unknown: step.unknown,
  }));
  change(id, (one) => ({ ...one, trace: joined(points, one.trace) }));
}

function pointOf(belief: Belief): TracePoint {
  const best = belief.objects[0];
  return {
    revision: belief.revision,
    nReadings: belief.n_readings,
    entropyBits: belief.entropy_bits,
    best: best?.name,
    probability: best?.probability ?? 0,
    unknown: belief.unknown ?? 0,
  };
}

/** Merges two traces, one point per revision. */
function joined(a: TracePoint[], b: TracePoint[]): TracePoint[] {
  const all = new Map([...a, ...b].map((point) => [point.revision, point]));
  return [...all.values()].sort((x, y) => x.revision - y.revision).slice(-200);
}
