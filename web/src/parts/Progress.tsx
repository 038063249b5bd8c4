// How far a training is: the stage, a bar, and what is left.
import type { Job } from "../api/types";
import { duration } from "../format";

const STAGES: Record<string, string> = {
  sampling: "Touching meshes in simulation",
  vocabulary: "Learning classes of appearance",
  mapping: "Mapping the objects",
  surface: "Learning surfaces",
  geometric: "Learning maps of contact",
  appearance: "Learning appearance",
  storing: "Storing the version",
};

export function Progress({ job }: { job: Job }) {
  const share = job.total > 0 ? job.done / job.total : undefined;
  const stage = job.state === "queued" ? "Waiting for its turn" : (STAGES[job.stage ?? ""] ?? "Running");
  return (
    <div class="progress">
      <div class="progress-head">
        <span>{stage}</span>
        <span class="faint">
          {job.total > 0 && `${job.done} of ${job.total}`}
          {typeof job.eta_s === "number" && ` · ${duration(job.eta_s)} left`}
        </span>
      </div>
      <progress max="1" {...(share === undefined ? {} : { value: share })} aria-label={stage} />
    </div>
  );
}
