// The slider over a session's revisions.
import { useEffect, useState } from "preact/hooks";
import { bits, percent, plural } from "../format";
import { Panel } from "../parts/Panel";
import type { SessionModel, Step } from "./model";

const STEP_MS = 700;

export function ReplayPanel({ model }: { model: SessionModel }) {
  const newest = model.newest.value?.revision ?? 0;
  const revision = model.revision.value;
  const [playing, setPlaying] = useState(false);
  useEffect(() => {
    if (!playing) return;
    let timer = 0;
    let frame = 0;
    const step = () => {
      const here = model.revision.peek();
      const last = model.newest.peek()?.revision ?? 0;
      if (here >= last) {
        setPlaying(false);
        return;
      }
      void model.show(here + 1);
      // Timed from the last frame, so that the page stays responsive if frames are slow.
      frame = requestAnimationFrame(() => {
        frame = requestAnimationFrame(() => (timer = window.setTimeout(step, STEP_MS)));
      });
    };
    timer = window.setTimeout(step, STEP_MS);
    return () => {
      clearTimeout(timer);
      cancelAnimationFrame(frame);
    };
  }, [model, playing]);
  const play = () => {
    if (!playing && revision >= newest) void model.show(0);
    setPlaying(!playing);
  };
  const words = say(model.steps.value.find((step) => step.revision === revision), revision, model.changeAt(revision));
  return (
    <Panel title="Replay" aside={<span class="num">revision {revision} of {newest}</span>}>
      <div class="replay">
        <button type="button" disabled={newest === 0} onClick={play}>
          {playing ? "Pause" : "Play"}
        </button>
        <input
          type="range"
          min={0}
          max={newest}
          step={1}
          value={revision}
          disabled={newest === 0}
          aria-label="Revision"
          aria-valuetext={words}
          onInput={(event) => {
            setPlaying(false);
            void model.show(Number(event.currentTarget.value));
          }}
        />
        <button type="button" aria-pressed={model.at.value === null} onClick={() => void model.show(null)}>
          Newest
        </button>
      </div>
      <p class="replay-say">{words}</p>
    </Panel>
  );
}

function say(step: Step | undefined, revision: number, change: ReturnType<SessionModel["changeAt"]>): string {
  if (revision === 0) return "Before the first reading.";
  if (step === undefined) return `Revision ${revision}.`;
  const best = step.objects[0];
  const came = change && { reading: ", a reading arrived", retraction: ", a reading was retracted", closed: ", the session was closed" }[change];
  const unknown = step.unknown > (best?.probability ?? 0);
  const answer = unknown ? `none of these ${percent(step.unknown)}` : best ? `${best.name} ${percent(best.probability)}` : "no answer";
  return `Revision ${revision}${came ?? ""} (${plural(step.nReadings, "reading")}): ${answer}, ${bits(step.entropyBits)} of uncertainty.`;
}
