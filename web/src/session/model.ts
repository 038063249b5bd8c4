// State of a session's page: live belief, history, readings, and the shown revision.
import { computed, signal } from "@preact/signals";
import { follow } from "../api/events";
import { ask, getAll, getJson, ProblemError, sendJson } from "../api/http";
import { persist, problemFrom } from "../api/resource";
import type { Belief, BestObject, CatalogueVersion, CloseSession, Explanation, Problem, ReadingContribution, Replay, Sensor, Session, SessionEvent, SessionReading } from "../api/types";

/** The answer at a revision. */
export interface Step {
  revision: number;
  nReadings: number;
  objects: BestObject[];
  unknown: number;
  entropyBits: number;
}

/** Colouring of touches: by what leaving each out would change, by what it changed when it came, or by its fit. */
export type ColorBy = "bits" | "came" | "fit";

/** The name of a robot under which the page sends a retracted reading again. */
export const PUT_BACK = "put-back";

/** Below this, leaving a reading out changes nothing: no single reading changes a sure answer. */
const BITS_MIN = 0.05;
/** Bits at which colours are full; the scale of fits ends at the largest one, if that is larger. */
export const FULL_BITS = 4;

const REPLAY_PAGE = 200;
/** Explaining refolds the readings without each of them, so it waits until readings pause. */
const EXPLAIN_AFTER_MS = 700;
const LIST_AFTER_MS = 150;

export class SessionModel {
  readonly session = signal<Session | undefined>(undefined);
  readonly version = signal<CatalogueVersion | undefined>(undefined);
  readonly sensors = signal(new Map<string, Sensor>());
  readonly newest = signal<Belief | undefined>(undefined);
  readonly steps = signal<Step[]>([]);
  readonly readings = signal<SessionReading[]>([]);
  readonly explanation = signal<Explanation | undefined>(undefined);
  readonly explaining = signal(false);
  readonly explainProblem = signal<Problem | undefined>(undefined);
  readonly problem = signal<Problem | undefined>(undefined);
  /** Whether the first revision to show is shown. */
  readonly begun = signal(false);
  readonly deleted = signal(false);
  /** Chosen colouring of touches; undefined for automatic. */
  readonly colorBy = signal<ColorBy | undefined>(undefined);
  /** Revision of the slider; null follows the newest. */
  readonly at = signal<number | null>(null);
  private readonly past = signal(new Map<number, Belief>());

  readonly revision = computed(() => this.at.value ?? this.newest.value?.revision ?? 0);
  /** Belief of the selected revision; the one shown before while it loads. */
  readonly shown = computed<Belief | undefined>((): Belief | undefined => {
    const { value: at } = this.at;
    const known = at === null ? this.newest.value : (this.past.value.get(at) ?? this.lastShown);
    this.lastShown = known ?? this.lastShown;
    return known;
  });
  /** Revision that the shown belief really is of. */
  readonly shownRevision = computed(() => this.shown.value?.revision ?? 0);
  /** Whether the selected revision has not arrived, so that another one is shown. */
  readonly isStale = computed(() => this.shown.value !== undefined && this.shownRevision.value !== this.revision.value);
  /** Effective colouring: as chosen; else by leaving out, unless that changes nothing: then by fit, or if the readings
   * are too few for that, by what each changed when it came. */
  readonly coloring = computed<ColorBy>(() => {
    const readings = this.explanation.value?.readings ?? [];
    const isSaturated = readings.every((one) => Math.abs(one.bits ?? 0) < BITS_MIN);
    const hasFit = readings.some((one) => typeof one.fit_bits === "number");
    return this.colorBy.value ?? (!isSaturated ? "bits" : hasFit ? "fit" : "came");
  });
  /** By how many bits the arrival of each reading raised the answer's probability, after the readings before it. */
  readonly came = computed(() => {
    const answer = this.explanation.value?.answer;
    const steps = fromPrior(this.prior.value, this.steps.value);
    const at = new Map(steps.map((step) => [step.revision, answer === undefined ? undefined : probabilityOf(step, answer)]));
    return new Map(this.readings.value.map(({ number }): [number, number | undefined] => {
      const [before, after] = [at.get(number), at.get(number + 1)];
      return [number, before && after ? Math.log2(after / before) : undefined];
    }));
  });
  /** The belief before the first reading. */
  readonly prior = signal<Belief | undefined>(undefined);
  /** What made a revision, as the server lists the readings; undefined until it has. */
  changeAt(revision: number): "reading" | "retraction" | "closed" | undefined {
    const readings = this.readings.value;
    if (readings.some((one) => one.retracted_by === revision)) return "retraction";
    if (readings.some((one) => one.number + 1 === revision)) return "reading";
    const { session } = this;
    return session.value?.state === "closed" && session.value.revision === revision ? "closed" : undefined;
  }
  /** Bits at which a colour is full. */
  readonly fullAt = computed(() => {
    const fits = (this.explanation.value?.readings ?? []).map((one) => Math.abs(one.fit_bits ?? 0));
    return this.coloring.value === "fit" ? Math.max(FULL_BITS, ...fits) : FULL_BITS;
  });
  /** Value that colours a reading, on the scale of bits. */
  readonly tints = computed(() => {
    const scale = FULL_BITS / this.fullAt.value;
    const tint = (bits: number | null | undefined) => (typeof bits === "number" ? bits * scale : null);
    return new Map(this.explanation.value?.readings.map((one) => [one.number, tint(this.valueOf(one))]));
  });
  /** The value of a reading that is shown and coloured, in bits. */
  valueOf(one: ReadingContribution | undefined): number | null | undefined {
    if (one === undefined) return undefined;
    return { bits: one.bits, came: this.came.value.get(one.number), fit: one.fit_bits }[this.coloring.value];
  }
  private lastShown: Belief | undefined;
  private readonly abort = new AbortController();
  private explainTimer: ReturnType<typeof setTimeout> | undefined;
  private listTimer: ReturnType<typeof setTimeout> | undefined;

  /** Begins at a revision, or with null at the newest. */
  constructor(readonly id: string, private readonly from: number | null = null) {}

  private get path(): string {
    return `/v1/sessions/${encodeURIComponent(this.id)}`;
  }

  async start(): Promise<void> {
    const { signal: aborted } = this.abort;
    try {
      await this.persist(() => this.load(aborted));
      const shown = this.show(this.from);
      this.begun.value = true;
      await shown;
      await follow(`${this.path}/events`, aborted, (event) => this.take(JSON.parse(event.data) as SessionEvent), () => this.listSoon());
    } catch (error) {
      if (aborted.aborted) return;
      if (error instanceof ProblemError && error.status === 404 && this.session.value) this.deleted.value = true;
      else this.problem.value = problemFrom(error);
    }
  }

  private async load(aborted: AbortSignal): Promise<void> {
    const session = await getJson<Session>(this.path, aborted);
    this.session.value = session;
    const version = `/v1/catalogues/${encodeURIComponent(session.catalogue)}/versions/${session.version}`;
    const [sensors, found, prior] = await Promise.all([
      getAll<Sensor>("/v1/sensors", 1000, aborted),
      getJson<CatalogueVersion>(version, aborted),
      getJson<Belief>(`${this.path}/belief?at=0`, aborted),
      this.list(),
      this.replay(),
    ]);
    this.sensors.value = new Map(sensors.map((sensor) => [sensor.id, sensor]));
    this.version.value = found;
    this.prior.value = prior;
  }

  /** Repeats a request while the server is away, and shows that it is. */
  private async persist<T>(request: () => Promise<T>): Promise<T> {
    const done = await persist(request, this.abort.signal, (problem) => (this.problem.value = problem));
    this.problem.value = undefined;
    return done;
  }

  stop(): void {
    clearTimeout(this.explainTimer);
    clearTimeout(this.listTimer);
    this.abort.abort();
  }

  /** Shows a revision; null follows the newest. */
  async show(at: number | null): Promise<void> {
    const newest = this.newest.value?.revision;
    this.at.value = at !== null && newest !== undefined && at >= newest ? null : at;
    this.explainSoon();
    const wanted = this.at.value;
    if (wanted === null || this.past.value.has(wanted)) return;
    try {
      const path = `${this.path}/belief?at=${wanted}&poses=5`;
      // Given up once another revision is selected.
      const request = async () => (this.at.value === wanted ? getJson<Belief>(path, this.abort.signal) : undefined);
      const belief = await this.persist(request);
      if (belief !== undefined) this.past.value = new Map(this.past.value).set(wanted, belief);
    } catch (error) {
      if (!this.abort.signal.aborted) this.problem.value = problemFrom(error);
    }
  }

  /** Retracts a reading. */
  async withdraw(number: number): Promise<void> {
    await ask(`${this.path}/readings/${number}?belief=none`, { method: "DELETE" });
    await this.list();
    this.newest.value = await getJson<Belief>(`${this.path}/belief`);
    await this.replay();
    await this.show(null);
  }

  /** Sends a retracted reading again, as a new one with the same content: what is stored never changes. Once, however
   * often it is asked for. */
  async putBack(retracted: SessionReading): Promise<void> {
    const { approach_m, contact, feature, image, number, object_moved, pose, sensor, shear, stamp } = retracted;
    const reading = {
      sensor, approach_m, pose, feature, object_moved, shear, stamp,
      ...(contact ? { contact } : { image }),
      robot: PUT_BACK, seq: number,
    };
    const given = Object.fromEntries(Object.entries(reading).filter(([, value]) => value !== null && value !== undefined));
    await sendJson("POST", `${this.path}/readings?belief=none`, { readings: [given] });
    await this.list();
    this.newest.value = await getJson<Belief>(`${this.path}/belief`);
    await this.replay();
    await this.show(null);
  }

  /** Closes the session, or records what its object really was. */
  async close(truth: CloseSession): Promise<void> {
    this.session.value = await sendJson<Session>("POST", `${this.path}/close`, truth);
  }

  async label(labels: Record<string, string>): Promise<void> {
    this.session.value = await sendJson<Session>("PUT", `${this.path}/labels`, { labels });
  }

  private take(event: SessionEvent): boolean {
    if (event.kind === "deleted") {
      this.deleted.value = true;
      return true;
    }
    if (event.kind === "closed") {
      this.session.value = event.session;
      return event.session.state === "closed";
    }
    const { belief } = event;
    const before = this.steps.value.at(-1)?.revision ?? 0;
    this.newest.value = belief;
    if (belief.revision === before + 1) this.steps.value = [...this.steps.value, stepOf(belief)];
    else if (belief.revision > before) this.persist(() => this.replay()).catch(() => undefined);
    this.listSoon();
    this.explainSoon();
    return false;
  }

  /** Lists the readings once for all events of a moment. */
  private listSoon(): void {
    this.listTimer ??= setTimeout(() => {
      this.listTimer = undefined;
      this.persist(() => this.list()).catch(() => undefined);
    }, LIST_AFTER_MS);
  }

  private async list(): Promise<void> {
    this.readings.value = await getAll<SessionReading>(`${this.path}/readings`, 2000, this.abort.signal);
  }

  /** Loads the missing steps, page by page. */
  private async replay(): Promise<void> {
    for (;;) {
      const after = this.steps.value.at(-1)?.revision ?? 0;
      const replay = await getJson<Replay>(`${this.path}/replay?after=${after}&limit=${REPLAY_PAGE}&poses=5`, this.abort.signal);
      const known = this.steps.value.at(-1)?.revision ?? 0;
      const fresh = replay.steps.filter((step) => step.revision > known);
      this.steps.value = [
        ...this.steps.value,
        ...fresh.map((step): Step => ({
          revision: step.revision,
          nReadings: step.n_readings,
          objects: step.objects ?? [],
          unknown: step.unknown,
          entropyBits: step.entropy_bits,
        })),
      ];
      if ((this.newest.value?.revision ?? -1) < replay.belief.revision) this.newest.value = replay.belief;
      if (replay.next_after === null || replay.next_after === undefined) return;
    }
  }

  private explainSoon(): void {
    clearTimeout(this.explainTimer);
    this.explainTimer = setTimeout(() => void this.explain(), EXPLAIN_AFTER_MS);
  }

  private async explain(): Promise<void> {
    const revision = this.revision.value;
    if (revision === 0) {
      this.explanation.value = undefined;
      return;
    }
    if (this.explanation.value?.revision === revision) return;
    this.explaining.value = true;
    try {
      const path = `${this.path}/explain?at=${revision}`;
      const request = () => getJson<Explanation>(path, this.abort.signal);
      const explanation = await persist(request, this.abort.signal, (problem) => (this.explainProblem.value = problem));
      if (this.revision.value !== revision) return;
      this.explanation.value = explanation;
      this.explainProblem.value = undefined;
    } catch (error) {
      if (!this.abort.signal.aborted) this.explainProblem.value = problemFrom(error);
    } finally {
      this.explaining.value = false;
    }
  }
}

/** The steps, with the belief before the first reading in front. */
export function fromPrior(prior: Belief | undefined, steps: Step[]): Step[] {
  return prior === undefined || steps.length === 0 ? steps : [{ ...stepOf(prior), objects: prior.objects }, ...steps];
}

/** The step that a live belief makes. */
export function stepOf(belief: Belief): Step {
  return {
    revision: belief.revision,
    nReadings: belief.n_readings,
    objects: belief.objects.slice(0, 10),
    unknown: belief.unknown ?? 0,
    entropyBits: belief.entropy_bits,
  };
}

/** The probability of an answer at a step; undefined if the step does not list it. */
function probabilityOf(step: Step, answer: Explanation["answer"]): number | undefined {
  return answer.object ? step.objects.find((one) => one.object === answer.object)?.probability : step.unknown;
}
