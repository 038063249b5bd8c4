// One session: belief, pose, touches and history.
import { useEffect, useMemo, useState } from "preact/hooks";
import { announce } from "../announce";
import { isUnanswered } from "../api/http";
import { silentSince } from "../api/pulse";
import { answerOf, titleOf } from "../belief";
import { percent, plural, shortId, when } from "../format";
import { Empty, Loading, ProblemNote } from "../parts/Notes";
import { Live } from "../parts/Live";
import { Badge, ViewHead } from "../parts/Panel";
import { useAction } from "../parts/useAction";
import { link, replaceRoute, route, useChoice } from "../router";
import { may } from "../signin";
import { methodWords } from "../words";
import { BeliefPanel } from "./BeliefPanel";
import { CloseDialog } from "./CloseDialog";
import { ExplainPanel } from "./ExplainPanel";
import { exportSession } from "./export";
import { LabelsPanel } from "./LabelsPanel";
import { SessionModel } from "./model";
import { NextTouchPanel, useNextTouches } from "./NextTouch";
import { PosteriorPanel } from "./PosteriorPanel";
import { ReplayPanel } from "./ReplayPanel";
import { ScenePanel } from "./ScenePanel";
import { StripPanel } from "./StripPanel";

export function SessionView({ id, at }: { id: string; at?: string }) {
  // biome-ignore lint/correctness/useExhaustiveDependencies: another revision is shown by the same model
  const model = useMemo(() => new SessionModel(id, momentOf(at)), [id]);
  const [closing, setClosing] = useState(false);
  const [chosen, setChosen] = useChoice("reading");
  const selected = /^\d+$/.test(chosen) && Number(chosen) > 0 ? Number(chosen) - 1 : undefined;
  const select = (number: number | undefined) => setChosen(number === undefined ? "" : String(number + 1));
  const action = useAction();
  useEffect(() => {
    void model.start();
    return () => model.stop();
  }, [model]);
  useBeliefAnnouncements(model);
  useLinkToMoment(model);
  const next = useNextTouches(model);
  const session = model.session.value;
  const title = believedTitle(model);
  if (session === undefined) {
    return (
      <>
        <ViewHead title={`Session ${shortId(id)}`} />
        {model.problem.value && <ProblemNote problem={model.problem.value} />}
        {(!model.problem.value || isUnanswered(model.problem.value)) && <Loading what="the session" lines={10} />}
      </>
    );
  }
  return (
    <>
      <ViewHead
        title={title}
        sub={
          <>
            <a href={link("models", session.catalogue, session.version)}>
              {session.catalogue} version {session.version}
            </a>
            {" · "}
            {methodWords(session.method)} · since {when(session.created_at)} · <code>{id}</code>
          </>
        }
      >
        {session.state === "closed" ? <span class="live">closed</span> : <Live />}
        <Badge kind={session.state}>{plural(model.newest.value?.n_readings ?? session.n_readings, "reading")}</Badge>
        <button type="button" disabled={action.busy} onClick={() => action.run(() => exportSession(id, "json"))}>Save as JSON</button>
        <button type="button" disabled={action.busy} onClick={() => action.run(() => exportSession(id, "csv"))}>Save as CSV</button>
        {may("robot", "admin") && (session.state === "open" || !session.truth) && (
          <button type="button" onClick={() => setClosing(true)}>
            {session.state === "open" ? "Close session …" : "It was …"}
          </button>
        )}
      </ViewHead>
      {model.deleted.value && <Empty title="This session has been deleted" />}
      {model.problem.value && <ProblemNote problem={model.problem.value} />}
      {action.problem && <ProblemNote problem={action.problem} />}
      {closing && <CloseDialog model={model} onClose={() => setClosing(false)} />}
      <div class={model.problem.value && silentSince.value === undefined ? "session old" : "session"}>
        <div class="stack">
          <ScenePanel model={model} selected={selected} select={select} next={next.shown} />
          <ReplayPanel model={model} />
          <StripPanel model={model} selected={selected} select={select} />
          <ExplainPanel model={model} selected={selected} select={select} />
        </div>
        <div class="stack">
          <BeliefPanel model={model} />
          <PosteriorPanel model={model} />
          <NextTouchPanel next={next} />
          <LabelsPanel model={model} />
        </div>
      </div>
    </>
  );
}

/** Keeps the address of the page a link to the shown revision, and shows the revision of a link that is followed. */
function useLinkToMoment(model: SessionModel): void {
  const { id } = model;
  const at = model.at.value;
  const begun = model.begun.value;
  useEffect(() => {
    // Unless another page is there by now.
    if (begun && route.peek()[1] === id) replaceRoute(...(at === null ? ["sessions", id] : ["sessions", id, "at", at]));
  }, [id, at, begun]);
  useEffect(() => {
    const follow = () => {
      const [, of, , linked] = route.peek();
      if (of === id) void model.show(momentOf(linked));
    };
    addEventListener("hashchange", follow);
    return () => removeEventListener("hashchange", follow);
  }, [id, model]);
}

/** The revision that an address names; null, the newest, if it names none. */
function momentOf(linked: string | undefined): number | null {
  return linked !== undefined && /^\d+$/.test(linked) ? Number(linked) : null;
}

/** The title of the page: what is believed now, of which robots. */
function believedTitle(model: SessionModel): string {
  const newest = model.newest.value;
  const robots = [...new Set(model.readings.value.flatMap((reading) => reading.robot ?? []))];
  const whose = robots.length > 0 ? robots.join(", ") : `session ${shortId(model.id)}`;
  return titleOf(answerOf(newest, newest?.n_readings ?? 0), whose);
}

/** Announces when the likeliest object changes or becomes sure. */
function useBeliefAnnouncements(model: SessionModel): void {
  const belief = model.shown.value;
  const best = belief?.objects[0];
  const isUnknown = (belief?.unknown ?? 0) > (best?.probability ?? 0);
  const name = isUnknown ? "none of the known objects" : best?.name;
  const p = isUnknown ? (belief?.unknown ?? 0) : (best?.probability ?? 0);
  const level = p >= 0.95 ? "sure" : p >= 0.5 ? "likely" : "open";
  // biome-ignore lint/correctness/useExhaustiveDependencies: says the change of an answer, not every reading
  useEffect(() => {
    if (belief === undefined || belief.n_readings === 0 || name === undefined) return;
    announce(`After ${plural(belief.n_readings, "reading")}: ${name}, ${percent(p)}`);
  }, [name, level, model.at.value]);
}
