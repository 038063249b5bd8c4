// A 3-D scene within a view: loads the 3-D chunk on first use and reports failures.
import { useEffect, useRef, useState } from "preact/hooks";
import { dark } from "../format";
import type { Content } from "./content";
import { loadScene } from "./load";
import type { Stage } from "./stage";

interface Props {
  content: Content;
  label: string;
  note?: string;
  empty?: string;
  selected?: number | undefined;
  onSelect?: (touch: number | undefined) => void;
  onHover?: (touch: number | undefined) => void;
  /** Told the share of the surface that was touched, if that is drawn. */
  onCovered?: (share: number | undefined) => void;
  /** Given the stage, to save what it shows. */
  onReady?: (stage: Stage | undefined) => void;
}

export function Stage3D(props: Props) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const over = useRef<HTMLCanvasElement>(null);
  const stage = useRef<Stage | undefined>(undefined);
  const newest = useRef(props);
  newest.current = props;
  const [state, setState] = useState<"loading" | "ready" | "impossible">("loading");
  const isDark = dark.value;
  useEffect(() => {
    let gone = false;
    loadScene().then(
      ({ Stage: Made }) => {
        if (gone || canvas.current === null || over.current === null) return;
        stage.current = new Made(canvas.current, over.current, {
          onSelect: (touch) => newest.current.onSelect?.(touch),
          onHover: (touch) => newest.current.onHover?.(touch),
        });
        newest.current.onReady?.(stage.current);
        setState("ready");
      },
    ).catch(() => {
      if (!gone) setState("impossible");
    });
    return () => {
      gone = true;
      newest.current.onReady?.(undefined);
      stage.current?.dispose();
      stage.current = undefined;
    };
  }, []);
  useEffect(() => {
    if (stage.current === undefined) return;
    const share = stage.current.show(props.content);
    newest.current.onCovered?.(share);
  }, [props.content, state, isDark]);
  useEffect(() => {
    stage.current?.select(props.selected);
  }, [props.selected, state]);
  const keys = props.onSelect ? "Arrow keys rotate, plus and minus zoom, 0 resets, n and p select a touch." : "Arrow keys rotate, plus and minus zoom, 0 resets.";
  return (
    <>
      <div class="stage" data-state={state}>
        {state === "impossible" ? (
          <p class="stage-fault">This browser cannot draw in 3-D (WebGL). The numbers are in the tables.</p>
        ) : (
          <>
            <canvas ref={canvas} tabIndex={0} role="img" aria-label={`${props.label}. ${keys}`} />
            <canvas ref={over} class="stage-over" aria-hidden="true" />
            {state === "loading" && <p class="stage-fault">Loading the view …</p>}
            {state === "ready" && props.empty && <p class="stage-fault">{props.empty}</p>}
          </>
        )}
      </div>
      {props.note && <p class="stage-note">{props.note}</p>}
    </>
  );
}
