//! The end of a job: stored, then published; published first when the disk is too full to
//! store it.
//!
//! No follower waits for ever for such an end: it is published at once, and stored when there
//! is space. A restart before that counts the job as interrupted.

use std::sync::Arc;
use std::time::Duration;

use palpate_store::entity::{Job, JobState};
use palpate_store::error::StoreError;
use tokio::sync::watch;
use uuid::Uuid;

use super::Jobs;
use crate::clock::pause;
use crate::wire::training::job as shown;

/// Pause before another attempt to store an end.
const PAUSE: Duration = Duration::from_secs(1);

/// Result of a job.
#[derive(Clone, Debug)]
pub(super) struct Ending {
    pub(super) id: Uuid,
    pub(super) state: JobState,
    pub(super) version: Option<u32>,
    pub(super) reason: Option<String>,
    pub(super) report: Option<String>,
    pub(super) at_ms: u64,
}

impl Ending {
    fn write(&self, job: &mut Job) {
        job.state = self.state;
        job.version = self.version;
        job.error.clone_from(&self.reason);
        job.report.clone_from(&self.report);
        job.finished_at_ms = Some(self.at_ms);
    }
}

impl Jobs {
    /// Stores a job's end and publishes it.
    pub(super) async fn end(self: &Arc<Self>, ending: Ending, stopping: &watch::Receiver<bool>) {
        let id = ending.id;
        match self.store_end(&ending).await {
            Ok(job) => self.conclude(&job),
            Err(error) => {
                tracing::error!("Cannot store the end of job {id} yet: {error}");
                self.tell_end(&ending);
                let (jobs, stopping) = (Arc::clone(self), stopping.clone());
                tokio::spawn(async move { jobs.end_later(ending, stopping).await });
            }
        }
    }

    /// Publishes the end of a job that is not stored yet.
    fn tell_end(&self, ending: &Ending) {
        let (Some(control), Ok(Some(mut job))) =
            (self.control(ending.id), self.store.jobs().find(ending.id))
        else {
            self.unfinished.remove(&ending.id);
            return;
        };
        ending.write(&mut job);
        control.job.send_replace(shown(&job));
    }

    async fn end_later(self: Arc<Self>, ending: Ending, mut stopping: watch::Receiver<bool>) {
        while pause(PAUSE, &mut stopping).await {
            match self.store_end(&ending).await {
                Ok(job) => return self.conclude(&job),
                Err(error) => tracing::debug!("Job {} waits to be stored: {error}", ending.id),
            }
        }
    }

    async fn store_end(&self, ending: &Ending) -> Result<Job, StoreError> {
        // The end of a job frees its resources, so that it may use the reserve.
        let table = self.store.essential().jobs();
        let stored = table.update(ending.id, |now| {
            ending.write(now);
            Ok::<(), StoreError>(())
        });
        stored.await?
    }
}
