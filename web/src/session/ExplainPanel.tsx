// Contributions of the readings in bits, and the readings that disagree.
import { useEffect, useRef } from "preact/hooks";
import { bitsColor, mm, percent, signedBits } from "../format";
import { Loading, ProblemNote } from "../parts/Notes";
import { Badge, Panel } from "../parts/Panel";
import { useAction } from "../parts/useAction";
import { may } from "../signin";
import type { SessionModel } from "./model";

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
  const isOpen = model.session.value?.state === "open" && may("robot", "admin");
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
            {explanation.answer.name ?? "None of the known objects"} with {percent(explanation.answer.probability)}. Each
            reading adds this many bits to its probability (log2).
          </p>
          {explanation.nearest && (explanation.against ?? []).length > 0 && (
            <>
              <p>What speaks against {explanation.nearest.name}, which fits best ({percent(explanation.nearest.probability)}):</p>
              <ul class="objections">
                {explanation.against!.map((one) => <li key={one.code}>{one.detail}.</li>)}
              </ul>
            </>
          )}
          {model.coloring.value === "fit" && <p class="faint">Bars show how well each reading fits the others, because no single one changes the answer any more.</p>}
          {!explanation.complete && <p class="faint">Time ran out; some readings were not compared.</p>}
          <div ref={list} class="scroll explain" tabIndex={0} role="region" aria-label="Contributions of readings">
            <table>
              <thead>
                <tr>
                  <th scope="col">Reading</th>
                  <th scope="col"><span class="visually-hidden">As a bar</span></th>
                  <th scope="col" class="num">Bits</th>
                  <th scope="col" class="num">Fit</th>
                  <th scope="col" class="num" title="Above the surface of the object that fits best">Height</th>
                  <th scope="col"><span class="visually-hidden">Retract</span></th>
                </tr>
              </thead>
              <tbody>
                {[...explanation.readings].sort((a, b) => a.number - b.number).map((one) => (
                  <tr key={one.number} class={one.number === selected ? "chosen" : ""}>
                    <th scope="row">
                      <button type="button" class="plain small" aria-pressed={one.number === selected}
                        onClick={() => select(one.number === selected ? undefined : one.number)}>
                        {one.number + 1}{one.robot ? ` · ${one.robot}` : ""}
                      </button>
                    </th>
                    <td><Contribution bits={tints.get(one.number)} /></td>
                    <td class="num">{signedBits(one.bits)}</td>
                    <td class="num">{signedBits(one.fit_bits)}</td>
                    <td class="num">{typeof one.misfit?.height_m === "number" ? mm(one.misfit.height_m) : "–"}</td>
                    <td class="row-end">
                      {one.disagrees && <Badge kind="disagrees">disagrees</Badge>}
                      {(one.disagrees || one.number === selected) && isOpen && model.at.value === null && (
                        <button type="button" class="small danger" disabled={action.busy} onClick={() => action.run(() => model.withdraw(one.number))}>
                          Retract
                        </button>
                      )}
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
