// The belief at the shown revision: identities, entropy, the best pose.
import { bits, decimal, mm, plural } from "../format";
import { Loading } from "../parts/Notes";
import { Badge, Facts, Panel } from "../parts/Panel";
import { ProbabilityBars, shares } from "../parts/ProbabilityBars";
import type { SessionModel } from "./model";

/** The revision that is shown while the selected one has not arrived. */
export function Stale({ model }: { model: SessionModel }) {
  return (
    <span role="status">
      <Badge kind="warn">still revision {model.shownRevision.value}</Badge> revision {model.revision.value} is loading …
    </span>
  );
}

export function BeliefPanel({ model }: { model: SessionModel }) {
  const belief = model.shown.value;
  const at = model.at.value;
  const isStale = model.isStale.value;
  const aside =
    belief === undefined ? "" : isStale ? <Stale model={model} /> : at === null ? "newest" : <Badge kind="warn">as of revision {belief.revision}</Badge>;
  if (belief === undefined) {
    return (
      <Panel title="Belief" aside={aside}>
        <Loading what="the belief" lines={5} />
      </Panel>
    );
  }
  const pose = belief.poses[0];
  const frame = model.session.value?.frame_id ?? "the session's frame";
  const sigma = (i: number) => Math.sqrt(Math.max(0, pose?.covariance[i * 7] ?? 0));
  const spread = Math.hypot(sigma(0), sigma(1), sigma(2));
  const turn = Math.hypot(sigma(3), sigma(4), sigma(5));
  return (
    <Panel title="Belief" aside={aside} class={isStale ? "stale" : ""}>
      {(belief.warnings ?? []).map((warning) => (
        <p class="note note-warn" key={warning.code} role="status">{warning.detail}</p>
      ))}
      <ProbabilityBars of={shares(belief.objects, belief.unknown ?? 0, 6)} label="Likeliest objects" />
      <div class="belief-facts">
        <Facts
          of={[
            ["Uncertainty", bits(belief.entropy_bits)],
            ["Based on", plural(belief.n_readings, "reading")],
            ...(pose
              ? ([
                  [`Position in ${frame}`, `${pose.pose.position.map((part) => decimal(part * 1000, 1)).join(", ")} mm`],
                  ["Accuracy (1 σ)", `${mm(spread)}, ${((turn * 180) / Math.PI).toFixed(0)}°`],
                ] as [string, string][])
              : []),
            ...(belief.stop
              ? ([["Risk of error", `${(belief.stop.found * 100).toFixed(1)} % (accepted ${(belief.stop.risk * 100).toFixed(1)} %)`]] as [string, string][])
              : []),
          ]}
        />
      </div>
      {(pose?.symmetry ?? []).length > 0 && (
        <p class="faint">
          Looks the same turned about {plural(pose!.symmetry!.length, "axis", "axes")}
          {pose!.symmetry!.some((axis) => axis.order === null) ? ", one of them by any angle" : ""}.
        </p>
      )}
    </Panel>
  );
}
