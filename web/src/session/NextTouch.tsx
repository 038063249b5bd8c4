// Suggested next touches for the newest belief of an open session.
import { useEffect, useState } from "preact/hooks";
import type { NextTouch as Touch, NextTouches, Problem } from "../api/types";
import { sendJson } from "../api/http";
import { persist, problemFrom } from "../api/resource";
import { bits, decimal, percent } from "../format";
import { Panel } from "../parts/Panel";
import { Table } from "../parts/Table";
import { methodWords } from "../words";
import type { SessionModel } from "./model";

const N = 3;
const LEAST_BITS = 0.01;
const DEADLINE_MS = 400;
/** Pause without new readings before suggestions are requested, so that a busy robot does not wait. */
const QUIET_MS = 900;

export interface Suggested {
  /** Why there are no suggestions; undefined if there are, or will be. */
  why: string | undefined;
  answer: NextTouches | undefined;
  problem: Problem | undefined;
  /** Suggestions in the scene; none while an older revision is shown. */
  shown: Touch[];
}

const NONE: Touch[] = [];

export function useNextTouches(model: SessionModel): Suggested {
  const [answer, setAnswer] = useState<NextTouches>();
  const [problem, setProblem] = useState<Problem>();
  const session = model.session.value;
  const revision = model.newest.value?.revision ?? 0;
  const sensor = model.readings.value.at(-1)?.sensor;
  const why = reason(session?.state, session?.method, revision);
  useEffect(() => {
    if (why !== undefined || sensor === undefined) return;
    const abort = new AbortController();
    const settle = (found: NextTouches | undefined, failed: Problem | undefined) => {
      if (abort.signal.aborted) return;
      setAnswer(found);
      setProblem(failed);
    };
    const timer = setTimeout(() => {
      const asked = { sensor, n: N, recenters: true, deadline_ms: DEADLINE_MS };
      const request = () => sendJson<NextTouches>("POST", `/v1/sessions/${model.id}/next-touches`, asked);
      persist(request, abort.signal, setProblem).then(
        (found) => settle(found, undefined),
        (error: unknown) => settle(undefined, problemFrom(error)),
      );
    }, QUIET_MS);
    return () => {
      clearTimeout(timer);
      abort.abort();
    };
  }, [model.id, why, sensor, revision]);
  const isCurrent = model.at.value === null && answer?.revision === revision && why === undefined;
  const learnt = answer !== undefined && answer.touches.length > 0 && !answer.touches.some(wouldTeach);
  const told = learnt ? "Nothing left to learn: no touch would add a hundredth of a bit." : undefined;
  return { why: why ?? told, answer, problem, shown: isCurrent && !learnt ? answer.touches : NONE };
}

/** Whether a touch is expected to say anything about the identity or the pose. */
export function wouldTeach(touch: Pick<Touch, "information_bits" | "pose_bits">): boolean {
  return touch.information_bits + (touch.pose_bits ?? 0) >= LEAST_BITS;
}

function reason(state: string | undefined, method: string | undefined, revision: number): string | undefined {
  if (state === "closed") return "The session is closed.";
  if (method !== undefined && method !== "surface") return `Suggestions need surface matching; this session uses ${methodWords(method)}.`;
  if (revision === 0) return "Suggestions need a first touch.";
  return undefined;
}

export function NextTouchPanel({ next }: { next: Suggested }) {
  return (
    <Panel title="Where to touch next" class="panel-next">
      {next.why !== undefined && <p class="faint">{next.why}</p>}
      {next.why === undefined && next.problem && <p class="faint">{next.problem.detail}</p>}
      {next.why === undefined && !next.problem && next.answer === undefined && <p class="faint">Waiting for the robot to pause …</p>}
      {next.why === undefined && next.answer && (
        <Table label="Suggested touches" columns={["Approach from (mm)", ["Identity (bits)", "num"], ["Pose (bits)", "num"], ["Contact", "num"]]}>
          {next.answer.touches.map((touch, place) => (
            <tr key={place}>
              <th scope="row">{touch.pose.position.map((part) => decimal(part * 1000, 0)).join(", ")}</th>
              <td class="num">{bits(touch.information_bits)}</td>
              <td class="num">{bits(touch.pose_bits)}</td>
              <td class="num">{percent(touch.contact_probability)}</td>
            </tr>
          ))}
        </Table>
      )}
    </Panel>
  );
}
