// Progress of a training: stage, bar and remaining time.
import type { Job } from "../api/types";
import { duration } from "../format";

const STAGES: Record<string, string> = {
  sampling: "Touching meshes in simulation",
  vocabulary: "Learning appearance classes",
  mapping: "Building pair maps",
  surface: "Learning surfaces",
  geometric: "Learning contact maps",
  appearance: "Learning appearance",
  storing: "Storing the version",
};

export function Progress({ job }: { job: Job }) {
  const share = job.total > 0 ? job.done / job.total : undefined;
  const stage = job.state === "queued" ? "Queued" : (STAGES[job.stage ?? ""] ?? "Running");
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
