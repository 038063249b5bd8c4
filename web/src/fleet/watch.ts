// State of the open sessions: listed every few seconds in the server's order, those that need
// attention first, and followed by one event stream.
import { effect, signal, untracked } from "@preact/signals";
import { follow } from "../api/events";
import { getJson } from "../api/http";
import { problemFrom } from "../api/resource";
import type { Belief, Fleet, FleetSession, Problem, SessionEvent, TracePoint as Point } from "../api/types";
import { query } from "../router";

/** State of an open session. */
export interface Watched {
  info: FleetSession;
  belief: Belief | undefined;
  /** Beliefs over the readings, oldest first. */
  trace: TracePoint[];
  /** When its newest reading arrived, by this browser's clock. */
  lastReadingAt: number | undefined;
  /** Since when its state holds, by this browser's clock. */
  since: number;
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
  nNeeded: number;
  more: boolean;
  loaded: boolean;
  problem: Problem | undefined;
}

const LIST_EVERY_MS = 3000;
const LIST_TIMEOUT_MS = 10_000;
/** Pause between an event and the list that it brings up to date. */
const SETTLE_MS = 500;
/** Number of sessions of a page, and of those whose beliefs one stream of events follows. */
const PAGE = 100;

/** The search and the number of pages, from the address. */
export function chosen(): { search: string; pages: number } {
  return { search: (query.value.get("search") ?? "").trim(), pages: Math.max(1, Number(query.value.get("pages")) || 1) };
}

export const fleet = signal<FleetState>({
  sessions: [],
  nOpen: 0,
  nNeeded: 0,
  more: false,
  loaded: false,
  problem: undefined,
});

let listNow: () => Promise<void> = async () => {};

/** Lists the sessions again, after somebody has changed them. */
export function relist(): Promise<void> {
  return listNow();
}

/** Starts watching; the returned function stops it. */
export function watchFleet(): () => void {
  const whole = new AbortController();
  let stream = new AbortController();
  let followed = "";
  let settling: ReturnType<typeof setTimeout> | undefined;

  let isListing = false;
  const list = async () => {
    if (isListing) return;
    isListing = true;
    const asked = JSON.stringify(chosen());
    try {
      let found = await everyPage(whole.signal, !fleet.value.loaded);
      // Sessions that are new here come with their past.
      if (fleet.value.loaded && found.sessions.some(isNew)) found = await everyPage(whole.signal, true);
      merge(found, Date.now() - Date.parse(found.at));
      const ids = found.sessions.slice(0, PAGE).map((one) => one.session.id).sort();
      if (ids.join() !== followed) restart(ids);
    } catch (error) {
      if (!whole.signal.aborted) fleet.value = { ...fleet.value, problem: problemFrom(error) };
    } finally {
      isListing = false;
      if (!whole.signal.aborted && asked !== JSON.stringify(chosen())) void list();
    }
  };

  const restart = (ids: string[]) => {
    stream.abort();
    stream = new AbortController();
    followed = ids.join();
    if (ids.length === 0) return;
    const path = `/v1/events?sessions=${ids.map(encodeURIComponent).join(",")}`;
    const told = (event: SessionEvent) => {
      take(event);
      settling ??= setTimeout(() => {
        settling = undefined;
        void list();
      }, SETTLE_MS);
    };
    follow(path, stream.signal, (event) => told(JSON.parse(event.data) as SessionEvent)).catch(() => {
      // The session is gone; the next list omits it.
      followed = "";
    });
  };

  fleet.value = { ...fleet.value, loaded: false };
  listNow = list;
  // At once, and when another search or number of pages is chosen.
  const stopListing = effect(() => {
    chosen();
    untracked(() => void list());
  });
  const timer = setInterval(() => {
    if (!document.hidden) void list();
  }, LIST_EVERY_MS);
  return () => {
    stopListing();
    clearInterval(timer);
    clearTimeout(settling);
    listNow = async () => {};
    whole.abort();
    stream.abort();
  };
}

/** The first pages of the fleet as one. */
async function everyPage(signal: AbortSignal, withTrace: boolean): Promise<Fleet> {
  const { search, pages } = chosen();
  const asked = `/v1/fleet?limit=${PAGE}&trace=${withTrace}${search === "" ? "" : `&search=${encodeURIComponent(search)}`}`;
  const get = (cursor: string) => getJson<Fleet>(`${asked}${cursor}`, signal, LIST_TIMEOUT_MS);
  const found = await get("");
  for (let page = 1; page < pages && found.next_cursor; page++) {
    const next = await get(`&cursor=${encodeURIComponent(found.next_cursor)}`);
    const known = new Set(found.sessions.map((one) => one.session.id));
    found.sessions.push(...next.sessions.filter((one) => !known.has(one.session.id)));
    found.next_cursor = next.next_cursor ?? null;
  }
  return found;
}

function isNew(one: FleetSession): boolean {
  return one.session.latest !== null && one.session.latest !== undefined && find(one.session.id) === undefined;
}

function find(id: string): Watched | undefined {
  return fleet.value.sessions.find((one) => one.info.session.id === id);
}

function merge(found: Fleet, clockAhead: number): void {
  const sessions = found.sessions.map((info): Watched => {
    const known = find(info.session.id);
    const last = info.last_reading_at;
    const lastReadingAt = last ? Date.parse(last) + clockAhead : undefined;
    const listed = [...info.trace, ...(info.session.latest ? [info.session.latest] : [])].map(shortened);
    const since = Date.parse(info.attention.since) + clockAhead;
    return { belief: known?.belief, trace: joined(listed, known?.trace ?? []), info, lastReadingAt, since };
  });
  fleet.value = {
    ...fleet.value,
    sessions,
    nOpen: found.n_open,
    nNeeded: found.n_needed,
    more: Boolean(found.next_cursor),
    loaded: true,
    problem: undefined,
  };
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

function shortened(point: Point): TracePoint {
  return {
    revision: point.revision,
    nReadings: point.n_readings,
    entropyBits: point.entropy_bits,
    best: point.best?.name,
    probability: point.best?.probability ?? 0,
    unknown: point.unknown,
  };
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

/** Merges two traces, one point per revision; the second one's points replace the first one's. */
export function joined(a: TracePoint[], b: TracePoint[]): TracePoint[] {
  const all = new Map([...a, ...b].map((point) => [point.revision, point]));
  return [...all.values()].sort((x, y) => x.revision - y.revision).slice(-200);
}
