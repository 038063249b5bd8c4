// What each reading changed, the readings that disagree, and the retraction of one.
import type { ComponentChildren } from "preact";
import { useEffect, useRef } from "preact/hooks";
import type { Session, SessionReading } from "../api/types";
import { bitsColor, decimal, percent, signedBits } from "../format";
import { Loading, ProblemNote } from "../parts/Notes";
import { Badge, Panel } from "../parts/Panel";
import { useAction } from "../parts/useAction";
import { may } from "../signin";
import { counts, hasLooseBase } from "./content";
import { type ColorBy, PUT_BACK, type SessionModel } from "./model";

interface Props {
  model: SessionModel;
  selected: number | undefined;
  select: (number: number | undefined) => void;
}

export function ExplainPanel({ model, selected, select }: Props) {
  const explanation = model.explanation.value;
  const problem = model.explainProblem.value;
  const tints = model.tints.value;
  const action = useAction();
  const list = useRef<HTMLDivElement>(null);
  useEffect(() => {
    const row = list.current?.querySelector<HTMLElement>(".chosen");
    // Only the list is scrolled, not the page.
    if (row && list.current) list.current.scrollTop = row.offsetTop - list.current.clientHeight / 2;
  }, [selected]);
  const mayChange = model.session.value?.state === "open" && may("robot", "admin") && model.at.value === null;
  const compared = new Map(explanation?.readings.map((one) => [one.number, one]));
  const upto = explanation?.revision ?? 0;
  // Retracted readings keep their rows; what was not compared yet has none.
  const rows = model.readings.value.filter(({ number }) => number < upto)
    .map((reading) => ({ reading, one: compared.get(reading.number) }))
    .filter(({ reading, one }) => one !== undefined || !counts(reading, upto));
  const retract = (reading: SessionReading) => {
    const whose = reading.robot ? ` of ${reading.robot}` : "";
    if (!confirm(`Retract reading ${reading.number + 1}${whose}? The belief is formed without it. It stays in the list, and can be put back.`)) return;
    action.run(() => model.withdraw(reading.number));
  };
  const nAgainst = explanation?.readings.filter((one) => one.disagrees).length ?? 0;
  const isStale = explanation !== undefined && explanation.revision !== model.revision.value;
  return (
    <Panel title="Contributions" class={isStale ? "stale" : ""} aside={isStale ? <Badge kind="warn">still revision {explanation.revision}</Badge> : model.explaining.value ? "comparing …" : nAgainst > 0 ? <Badge kind="bad">{nAgainst === 1 ? "1 disagrees" : `${nAgainst} disagree`}</Badge> : ""}>
      {problem && <ProblemNote problem={problem} />}
      {action.problem && <ProblemNote problem={action.problem} />}
      {explanation === undefined ? (
        model.revision.value === 0 ? <p class="faint">No readings to explain yet.</p>
          : !problem && <Loading what="the explanation" lines={4} />
      ) : (
        <>
          <p>
            {explanation.answer.name ?? "None of the known objects"} with {percent(explanation.answer.probability)}. In bits of its
            probability (log2): <b>when it came</b>, what a reading changed after those before it; <b>left out</b>, what would be
            lost without it alone, which is nothing as soon as the others say the same.
          </p>
          {explanation.nearest && (explanation.against ?? []).length > 0 && (
            <>
              <p>What speaks against {explanation.nearest.name}, which fits best ({percent(explanation.nearest.probability)}):</p>
              <ul class="objections">
                {explanation.against!.map((one) => <li key={one.code}>{one.detail}.</li>)}
              </ul>
            </>
          )}
          <p class="faint">Bars and colours: {COLORED[model.coloring.value]}.</p>
          {!explanation.complete && <p class="faint">Time ran out; some readings were not compared.</p>}
          <div ref={list} class="scroll explain" tabIndex={0} role="region" aria-label="Contributions of readings">
            <table>
              <thead>
                <tr>
                  <th scope="col">Reading</th>
                  <th scope="col"><span class="visually-hidden">As a bar</span></th>
                  <th scope="col" class="num">When it came (bit)</th>
                  <th scope="col" class="num">Left out (bit)</th>
                  <th scope="col" class="num" title="How well it fits the object in the pose that the others find">Fit (bit)</th>
                  <th scope="col" class="num" title="Above the surface of the object that fits best">Height (mm)</th>
                  <th scope="col"><span class="visually-hidden">Retract</span></th>
                </tr>
              </thead>
              <tbody>
                {rows.map(({ reading, one }) => (
                  <tr key={reading.number} class={`${reading.number === selected ? "chosen" : ""} ${one ? "" : "withdrawn"}`}>
                    <th scope="row">
                      <button type="button" class="plain small" aria-pressed={reading.number === selected}
                        onClick={() => select(reading.number === selected ? undefined : reading.number)}>
                        {reading.number + 1}{reading.robot ? ` · ${reading.robot}` : ""}
                      </button>
                    </th>
                    <td>{one && <Contribution bits={tints.get(reading.number)} />}</td>
                    <td class="num">{signedBits(model.came.value.get(reading.number))}</td>
                    <td class="num">{signedBits(one?.bits)}</td>
                    <td class="num">{signedBits(one?.fit_bits)}</td>
                    <td class="num">{typeof one?.misfit?.height_m === "number" ? decimal(one.misfit.height_m * 1000, 1) : "–"}</td>
                    <td class="row-end">
                      {one?.disagrees && <Badge kind="disagrees">disagrees</Badge>}
                      {one && (one.disagrees || reading.number === selected) && mayChange && (
                        <button type="button" class="small danger" disabled={action.busy} onClick={() => retract(reading)}>
                          Retract …
                        </button>
                      )}
                      {!one && <Retracted reading={reading} readings={model.readings.value} session={model.session.value}>
                        {mayChange && <button type="button" class="small" disabled={action.busy} onClick={() => action.run(() => model.putBack(reading))}>Put back</button>}
                      </Retracted>}
                    </td>
                  </tr>
                ))}
              </tbody>
            </table>
          </div>
        </>
      )}
    </Panel>
  );
}

const COLORED: Record<ColorBy, string> = {
  bits: "what would be lost without each reading",
  came: "what each reading changed when it came",
  fit: "how well each reading fits the others",
};

/** What became of a retracted reading. One of a robot with a loose base cannot be put back: it would be taken as exact. */
function Retracted({ reading, readings, session, children }: {
  reading: SessionReading; readings: SessionReading[]; session: Session | undefined; children: ComponentChildren;
}) {
  const again = readings.find((one) => one.robot === PUT_BACK && one.seq === reading.number);
  return (
    <>
      <Badge kind="seen" isPast>{again ? `put back as ${again.number + 1}` : "retracted"}</Badge>
      {again === undefined && (hasLooseBase(session, reading)
        ? <span class="faint">cannot be put back: the base of its robot is loose</span>
        : children)}
    </>
  );
}

/** A bar from the centre: left against, right for the answer; full at ±8 bits. */
function Contribution({ bits }: { bits: number | null | undefined }) {
  if (typeof bits !== "number") return null;
  const length = Math.min(1, Math.abs(bits) / 8) * 49;
  return (
    <svg class="contribution" viewBox="0 0 100 10" preserveAspectRatio="none" aria-hidden="true">
      <rect x={bits < 0 ? 50 - length : 50} y="1" width={Math.max(0.8, length)} height="8" fill={bitsColor(bits)} />
      <line x1="50" x2="50" y1="0" y2="10" stroke="currentColor" stroke-width="0.6" />
    </svg>
  );
}
