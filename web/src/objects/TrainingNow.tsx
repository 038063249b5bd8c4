// Trainings started on this page or already running, each with its progress, until dismissed.
import { signal } from "@preact/signals";
import { useEffect, useState } from "preact/hooks";
import { announce } from "../announce";
import { follow } from "../api/events";
import { getAll, sendJson } from "../api/http";
import { persist } from "../api/resource";
import type { Job } from "../api/types";
import { duration } from "../format";
import { Progress } from "../parts/Progress";
import { link } from "../router";
import { may } from "../signin";

/** Jobs to show; kept across views. */
export const startedJobs = signal<Job[]>([]);

export const isFinal = (job: Job) => ["succeeded", "failed", "cancelled"].includes(job.state);

export function TrainingNow({ onDone }: { onDone: () => void }) {
  useEffect(() => {
    const abort = new AbortController();
    persist(() => getAll<Job>("/v1/jobs", 5000, abort.signal), abort.signal).then(
      (jobs) => {
        const known = new Set(startedJobs.value.map((job) => job.id));
        const found = jobs.filter((job) => !isFinal(job) && !known.has(job.id));
        if (found.length > 0) startedJobs.value = [...startedJobs.value, ...found];
      },
      () => {
        // The view of jobs shows its own problem.
      },
    );
    return () => abort.abort();
  }, []);
  const dismiss = (id: string) => {
    startedJobs.value = startedJobs.value.filter((job) => job.id !== id);
  };
  return (
    <>
      {startedJobs.value.map((job) => (
        <OneJob key={job.id} started={job} onDone={onDone} onDismiss={() => dismiss(job.id)} />
      ))}
    </>
  );
}

function OneJob({ started, onDone, onDismiss }: { started: Job; onDone: () => void; onDismiss: () => void }) {
  const job = useJob(started, (ended) => {
    startedJobs.value = startedJobs.value.map((one) => (one.id === ended.id ? ended : one));
    onDone();
    announce(`Training of ${ended.catalogue} ${ended.state}`);
  });
  return (
    <div class={job.state === "failed" ? "note note-bad" : job.state === "succeeded" ? "note note-good" : "note"}>
      {isFinal(job) ? (
        <div class="note-foot">
          <span>
            {job.state === "succeeded" && typeof job.version === "number" ? (
              <>
                Trained <a href={link("models", job.catalogue, job.version)}>{job.catalogue} version {job.version}</a>
                {job.started_at && job.finished_at && ` in ${duration((Date.parse(job.finished_at) - Date.parse(job.started_at)) / 1000)}`}
              </>
            ) : (
              <>Training of {job.catalogue} {job.state}{job.reason ? `: ${job.reason}` : ""}</>
            )}
          </span>
          <button type="button" class="small" onClick={onDismiss}>Dismiss</button>
        </div>
      ) : (
        <div class="training">
          <Progress job={job} />
          {may("trainer", "admin") && (
            <button type="button" class="small" onClick={() => confirm(`Cancel the training of ${job.catalogue}? What it has done is lost.`) && void sendJson("POST", `/v1/jobs/${job.id}/cancel`).catch(() => undefined)}>
              Cancel
            </button>
          )}
        </div>
      )}
    </div>
  );
}

/** One job and its progress. */
export function useJob(started: Job, onEnd: (job: Job) => void): Job {
  const [job, setJob] = useState(started);
  // biome-ignore lint/correctness/useExhaustiveDependencies: one stream for the job, whatever the list says of it later
  useEffect(() => {
    if (isFinal(started)) return;
    const abort = new AbortController();
    follow(`/v1/jobs/${started.id}/events`, abort.signal, (event) => {
      const now = JSON.parse(event.data) as Job;
      setJob(now);
      if (isFinal(now)) onEnd(now);
      return isFinal(now);
    }).catch(() => {
      // The stream is lost; the view of jobs shows the outcome.
    });
    return () => abort.abort();
  }, [started.id]);
  return job;
}
