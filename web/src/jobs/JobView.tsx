// One job: its progress, and what it made or found.
import { getJson } from "../api/http";
import { useResource } from "../api/resource";
import type { Job } from "../api/types";
import { when } from "../format";
import { isFinal, useJob } from "../objects/TrainingNow";
import { Show } from "../parts/Notes";
import { Badge, Panel, ViewHead } from "../parts/Panel";
import { Progress } from "../parts/Progress";
import { link } from "../router";
import { ShadowPanels } from "./ShadowReport";

export function JobView({ id }: { id: string }) {
  const job = useResource(`job ${id}`, (signal) => getJson<Job>(`/v1/jobs/${encodeURIComponent(id)}`, signal));
  return (
    <>
      {!job.data && <ViewHead title="Job" sub={<a href={link("jobs")}>All jobs</a>} />}
      <Show of={job} what="the job" lines={6}>
        {(found) => <Shown job={found} onEnd={job.reload} />}
      </Show>
    </>
  );
}

function Shown({ job: found, onEnd }: { job: Job; onEnd: () => void }) {
  const followed = useJob(found, onEnd);
  const job = isFinal(found) ? found : followed;
  return (
    <>
      <ViewHead title={jobTitle(job)} sub={<><a href={link("jobs")}>All jobs</a> · requested {when(job.created_at)}</>}>
        <Badge kind={job.state} isPast={isFinal(job)}>{job.state}</Badge>
      </ViewHead>
      {!isFinal(job) && <Panel title="Progress"><Progress job={job} /></Panel>}
      {job.reason && <p class="note note-warn">{job.reason}</p>}
      {job.shadow_report ? <ShadowPanels catalogue={job.catalogue} report={job.shadow_report} /> : (
        typeof job.version === "number" && isFinal(job) && <p>It made <a href={link("models", job.catalogue, job.version)}>{job.catalogue} version {job.version}</a>.</p>
      )}
    </>
  );
}

/** What a job does: `Training default`. */
export function jobTitle(job: Job): string {
  const kind = job.shadow ? "Comparison in" : job.recalibration ? "Recalibration of" : "Training";
  return `${kind} ${job.catalogue}`;
}
