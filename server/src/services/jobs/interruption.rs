//! Jobs that a stop of the server interrupted, and the touches that they had taken.
//!
//! A job that was suspended by an orderly stop waits for the next start. After a crash it is done
//! again once, and once more whenever it had touched more objects than at the crash before, so that
//! long trainings end and a job that kills the server does not do so for ever.

use std::path::PathBuf;

use palpate_sim::kept::Kept;
use palpate_store::entity::{Job, JobState};
use palpate_store::error::StoreError;
use uuid::Uuid;

use super::Jobs;
use crate::clock::now_ms;
use crate::services::training::Keeping;

/// Marks a job that was interrupted by a stop of the server and queued again.
const INTERRUPTED: &str = "interrupted by a stop of the server";

/// The folder with the touches of unfinished trainings, one folder a job.
pub(super) struct Touched(PathBuf);

impl Touched {
    pub(super) fn in_folder(folder: PathBuf) -> Self {
        Self(folder)
    }

    fn folder(&self, job: Uuid) -> PathBuf {
        self.0.join(job.to_string())
    }

    /// The number of objects of a job whose touches are kept.
    fn n_objects(&self, job: Uuid) -> u64 {
        let folder = self.folder(job);
        let n = || if folder.is_dir() { Kept::open(&folder)?.n_files() } else { Ok(0) };
        n().unwrap_or_else(|error: std::io::Error| {
            tracing::warn!("Cannot look at kept touches: {error}");
            0
        }) as u64
    }

    /// Removes the touches of an ended job.
    pub(super) fn forget(&self, job: Uuid) {
        remove(&self.folder(job));
    }

    /// Removes the touches of all jobs but these.
    pub(super) fn forget_all_but(&self, unfinished: &[Uuid]) {
        let Ok(entries) = std::fs::read_dir(&self.0) else { return };
        for entry in entries.flatten() {
            let name = entry.file_name();
            let id = name.to_str().and_then(|name| Uuid::parse_str(name).ok());
            if id.is_some_and(|id| !unfinished.contains(&id)) {
                remove(&entry.path());
            }
        }
    }
}

fn remove(folder: &std::path::Path) {
    match std::fs::remove_dir_all(folder) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
            tracing::warn!("Cannot remove {}: {error}", folder.display());
        }
        _ => {}
    }
}

/// Whether an interrupted job is done again: once, and whenever more objects were touched than at
/// the interruption before.
fn goes_on(job: &Job, n_touched: u64) -> bool {
    !job.cancel_requested && (job.error.is_none() || n_touched > job.done)
}

impl Jobs {
    /// What keeps the touches of a job; `None` if its folder cannot be made.
    pub(super) fn keeping(&self, job: Uuid) -> Option<Keeping> {
        match Kept::open(&self.touched.folder(job)) {
            Ok(kept) => {
                let key = self.store.job_writer(job).ok().flatten().filter(|key| !key.is_nil());
                Some(Keeping::new(kept, self.store.clone(), key.zip(self.quota)))
            }
            Err(error) => {
                tracing::warn!("Cannot keep the touches of job {job}: {error}");
                None
            }
        }
    }

    /// Handles a job that was running when the server stopped.
    pub(super) async fn after_interruption(&self, job: Job) -> Result<Option<Job>, StoreError> {
        let made = self.catalogues.made_by(&job.catalogue, job.id)?;
        let n_touched = self.touched.n_objects(job.id);
        let again = made.is_none() && goes_on(&job, n_touched);
        let table = self.store.jobs();
        let changed = table.update(job.id, |now| {
            if now.state != JobState::Running {
                return Err(StoreError::Changed { what: "job", id: job.id });
            }
            now.version = made;
            now.finished_at_ms = (!again).then(now_ms);
            now.error = Some(INTERRUPTED.to_owned());
            now.done = n_touched;
            now.state = match made {
                Some(_) => JobState::Succeeded,
                None if again => JobState::Queued,
                None if job.cancel_requested => JobState::Cancelled,
                None => JobState::Failed,
            };
            Ok(())
        });
        let job = changed.await??;
        tracing::warn!(job.id = %job.id, "Job {} was {INTERRUPTED}: {:?} now", job.id, job.state);
        if !again && self.control(job.id).is_some() {
            self.conclude(&job);
        }
        Ok(again.then_some(job))
    }

    /// Queues a job again that an orderly stop of the server suspended.
    pub(super) async fn suspended(&self, id: Uuid) {
        let table = self.store.jobs();
        let queued = table.update(id, |now| {
            if now.state == JobState::Running && !now.cancel_requested {
                now.state = JobState::Queued;
            }
            Ok::<(), StoreError>(())
        });
        match queued.await.and_then(|queued| queued) {
            Ok(_) => tracing::info!(job.id = %id, "Suspended job {id}: the server stops"),
            // The next start counts it as interrupted.
            Err(error) => tracing::warn!(job.id = %id, "Cannot suspend job {id}: {error}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn job(error: Option<&str>, done: u64) -> Job {
        Job {
            id: Uuid::nil(),
            catalogue: "default".to_owned(),
            request: String::new(),
            state: JobState::Running,
            stage: String::new(),
            done,
            total: 0,
            cancel_requested: false,
            version: None,
            error: error.map(str::to_owned),
            report: None,
            created_at_ms: 0,
            started_at_ms: None,
            finished_at_ms: None,
        }
    }

    #[test]
    fn a_job_goes_on_after_a_crash_while_it_gets_further() {
        assert!(goes_on(&job(None, 0), 0), "the first crash");
        let again = job(Some(INTERRUPTED), 3);
        assert!(goes_on(&again, 4) && !goes_on(&again, 3), "later ones");
        assert!(!goes_on(&Job { cancel_requested: true, ..job(None, 0) }, 5));
    }

    #[test]
    fn touches_of_ended_jobs_are_removed() {
        let folder = tempfile::tempdir().unwrap();
        let touched = Touched::in_folder(folder.path().join("touches"));
        touched.forget(Uuid::nil());
        let [one, two] = [1, 2].map(Uuid::from_u128);
        for id in [one, two] {
            Kept::open(&touched.folder(id)).unwrap();
            std::fs::write(touched.folder(id).join("a.touches"), b"").unwrap();
        }
        assert_eq!([one, Uuid::nil()].map(|id| touched.n_objects(id)), [1, 0]);
        touched.forget_all_but(&[two]);
        assert_eq!([one, two].map(|id| touched.n_objects(id)), [0, 1]);
        touched.forget(two);
        assert!(!touched.folder(two).exists());
    }
}
