// A 3-D scene within a view: loads the 3-D chunk on first use and reports failures.
import { useEffect, useRef, useState } from "preact/hooks";
import { dark } from "../format";
import type { Content } from "./content";
import { loadScene } from "./load";
import type { Stage } from "./scene";

export function Stage3D(props: { content: Content; label: string; note?: string; empty?: string }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const stage = useRef<Stage | undefined>(undefined);
  const [state, setState] = useState<"loading" | "ready" | "impossible">("loading");
  const isDark = dark.value;
  useEffect(() => {
    let gone = false;
    loadScene().then(
      ({ Stage: Made }) => {
        if (gone || canvas.current === null) return;
        stage.current = new Made(canvas.current);
        setState("ready");
      },
    ).catch(() => {
      if (!gone) setState("impossible");
    });
    return () => {
      gone = true;
      stage.current?.dispose();
      stage.current = undefined;
    };
  }, []);
  useEffect(() => {
    stage.current?.show(props.content);
  }, [props.content, state, isDark]);
  return (
    <div class="stage" data-state={state}>
      {state === "impossible" ? (
        <p class="stage-fault">This browser cannot draw in 3-D (WebGL). The numbers are in the tables.</p>
      ) : (
        <>
          <canvas ref={canvas} tabIndex={0} role="img" aria-label={`${props.label}. Arrow keys rotate, plus and minus zoom, 0 resets.`} />
          {state === "loading" && <p class="stage-fault">Loading the view …</p>}
          {state === "ready" && props.empty && <p class="stage-fault">{props.empty}</p>}
          {props.note && !props.empty && <p class="stage-note">{props.note}</p>}
        </>
      )}
    </div>
  );
}
