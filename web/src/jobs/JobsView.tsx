// Jobs: trainings, recalibrations and comparisons, in progress and ended.
import { getAll, sendJson } from "../api/http";
import { useResource } from "../api/resource";
import type { Job } from "../api/types";
import { duration, plural, when } from "../format";
import { isFinal, useJob } from "../objects/TrainingNow";
import { TrainCommands } from "../parts/Commands";
import { Empty, ProblemNote, Show } from "../parts/Notes";
import { Badge, Panel, ViewHead } from "../parts/Panel";
import { Progress } from "../parts/Progress";
import { Table } from "../parts/Table";
import { useAction } from "../parts/useAction";
import { link } from "../router";
import { may } from "../signin";
import { jobTitle } from "./JobView";

export function JobsView() {
  const jobs = useResource("jobs", (signal) => getAll<Job>("/v1/jobs", 5000, signal), 5000);
  const under = jobs.data?.filter((job) => !isFinal(job)) ?? [];
  const ended = jobs.data?.filter(isFinal).reverse() ?? [];
  return (
    <>
      <ViewHead title="Jobs" sub={jobs.data ? `${under.length} in progress, ${ended.length} ended` : "Trainings run one at a time"} />
      <Show of={jobs} what="the jobs" lines={5}>
        {(found) =>
          found.length === 0 ? (
            <Empty title="No trainings yet">
              {may("trainer", "admin") && <p><a href={link("objects")}>Start one on the Objects page</a>, or:</p>}
              <TrainCommands />
            </Empty>
          ) : (
            <>
              {under.map((job) => (
                <Running key={job.id} job={job} onEnd={jobs.reload} />
              ))}
              {ended.length > 0 && <Ended jobs={ended} />}
            </>
          )
        }
      </Show>
    </>
  );
}

function Running({ job: started, onEnd }: { job: Job; onEnd: () => void }) {
  const job = useJob(started, onEnd);
  const action = useAction();
  return (
    <Panel
      title={jobTitle(job)}
      aside={
        may("trainer", "admin") && (
          <button type="button" class="small" disabled={action.busy} onClick={() => confirm(`Cancel: ${jobTitle(job)}? What it has done is lost.`) && action.run(async () => void (await sendJson("POST", `/v1/jobs/${job.id}/cancel`)))}>
            Cancel
          </button>
        )
      }
    >
      <Progress job={job} />
      {action.problem && <ProblemNote problem={action.problem} />}
    </Panel>
  );
}

function Ended({ jobs }: { jobs: Job[] }) {
  return (
    <Panel title="Ended" aside={plural(jobs.length, "job")}>
      <Table label="Ended jobs" columns={["Requested", "Job", "Version", "Outcome", ["Duration", "num"], "Reason"]}>
        {jobs.map((job) => (
          <tr key={job.id}>
            <th scope="row"><a href={link("jobs", job.id)}>{when(job.created_at)}</a></th>
            <td>{jobTitle(job)}</td>
            <td>
              {typeof job.version === "number" ? <a href={link("models", job.catalogue, job.version)}>Version {job.version}</a> : "–"}
            </td>
            <td><Badge kind={job.state} isPast>{job.state}</Badge></td>
            <td class="num">{job.started_at && job.finished_at ? duration((Date.parse(job.finished_at) - Date.parse(job.started_at)) / 1000) : "–"}</td>
            <td>{job.reason ?? ""}</td>
          </tr>
        ))}
      </Table>
    </Panel>
  );
}
