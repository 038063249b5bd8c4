// Two sessions side by side: what they were, what was believed, how it came about.
import { useEffect, useMemo } from "preact/hooks";
import { plural, shortId, when } from "../format";
import { Loading, ProblemNote } from "../parts/Notes";
import { Badge, Facts, Panel, ViewHead } from "../parts/Panel";
import { link } from "../router";
import { BeliefPanel } from "../session/BeliefPanel";
import { SessionModel } from "../session/model";
import { PosteriorPanel } from "../session/PosteriorPanel";
import { methodWords } from "../words";
import { labelWords, truthName } from "./words";

export function CompareView({ ids }: { ids: [string, string] }) {
  return (
    <>
      <ViewHead title={`Sessions ${shortId(ids[0])} and ${shortId(ids[1])}`} sub={<a href={link("sessions")}>All sessions</a>} />
      <div class="grid grid-2">{ids.map((id) => <One key={id} id={id} />)}</div>
    </>
  );
}

function One({ id }: { id: string }) {
  const model = useMemo(() => new SessionModel(id), [id]);
  useEffect(() => {
    void model.start();
    return () => model.stop();
  }, [model]);
  const session = model.session.value;
  if (session === undefined) return model.problem.value ? <ProblemNote problem={model.problem.value} /> : <Loading what={`session ${shortId(id)}`} lines={10} />;
  const truth = truthName(session);
  return (
    <div class="stack">
      <Panel title={`Session ${shortId(id)}`} aside={<Badge kind={session.state} isPast={session.state === "closed"}>{session.ended ?? session.state}</Badge>}>
        <Facts
          of={[
            ["Session", <a key="session" href={link("sessions", id)}>{shortId(id)}</a>],
            ["Robots", (session.touched_by ?? []).join(", ") || "–"],
            ["Readings", plural(session.n_readings, "reading")],
            ["Method", methodWords(session.method)],
            ["Catalogue", <a key="catalogue" href={link("models", session.catalogue, session.version)}>{session.catalogue} version {session.version}</a>],
            ["Truth", truth === undefined ? "–" : `${truth} (${session.truth?.was_right ? "right" : "wrong"})`],
            ["Labels", labelWords(session.labels) || "–"],
            ["Began", when(session.created_at)],
            ["Ended", when(session.closed_at)],
          ]}
        />
      </Panel>
      <BeliefPanel model={model} />
      <PosteriorPanel model={model} />
    </div>
  );
}
