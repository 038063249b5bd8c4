//! Jobs of servers that share a store: each job has one worker, the server that has its lease.
//!
//! A server whose worker dies or stops loses its leases, and another one takes its job over, as
//! after a stop of a single server. A worker that lost its lease stops: its job may be another's.

use palpate_store::engine::lease::Lease;
use palpate_store::entity::{Job, JobState};
use palpate_store::error::StoreError;
use uuid::Uuid;

use super::Jobs;
use super::control::{CANCEL, Control};
use crate::wire::training::job as shown;

impl Jobs {
    /// The oldest job that no server works on, and the right to work on it.
    pub(super) async fn next(&self) -> Result<Option<(Job, Lease)>, StoreError> {
        // A job whose end waits to be stored is over.
        let waiting = self.unfinished.iter().filter(|entry| !entry.is_over());
        let mut waiting: Vec<Uuid> = waiting.map(|entry| *entry.key()).collect();
        waiting.sort_unstable();
        for id in waiting {
            let Some(lease) = self.store.lease(&format!("job {id}")).await? else { continue };
            self.store.catch_up().await?;
            let Some(job) = self.store.jobs().find(id)? else {
                self.unfinished.remove(&id);
                continue;
            };
            let job = match job.state {
                JobState::Queued => Some(job),
                JobState::Running => self.after_interruption(job).await?,
                JobState::Succeeded | JobState::Failed | JobState::Cancelled => {
                    self.ended_elsewhere(&job);
                    None
                }
            };
            if let Some(job) = job {
                return Ok(Some((job, lease)));
            }
        }
        Ok(None)
    }

    /// Looks again at a job that another server changed.
    pub(crate) fn heard(&self, id: Uuid) -> Result<(), StoreError> {
        let Some(job) = self.store.jobs().find(id)? else {
            self.unfinished.remove(&id);
            return Ok(());
        };
        match self.control(id) {
            None if job.state.is_final() => {}
            None => {
                self.unfinished.insert(id, std::sync::Arc::new(Control::new(shown(&job))));
                self.wake.notify_one();
            }
            Some(control) if control.is_held() => {
                if job.cancel_requested {
                    control.order(CANCEL);
                }
            }
            Some(_) if job.state.is_final() => self.ended_elsewhere(&job),
            Some(control) => {
                control.job.send_replace(shown(&job));
                self.wake.notify_one();
            }
        }
        Ok(())
    }

    /// Looks again at all jobs. Blocks.
    pub(crate) fn heard_all(&self) -> Result<(), StoreError> {
        let known: Vec<Uuid> = self.unfinished.iter().map(|entry| *entry.key()).collect();
        let stored = self.store.jobs().list_whole(None, usize::MAX - 1)?.items;
        let unfinished = stored.iter().filter(|job| !job.state.is_final()).map(|job| job.id);
        known.into_iter().chain(unfinished).try_for_each(|id| self.heard(id))
    }

    /// Tells the followers of a job that another server ended, and forgets it.
    fn ended_elsewhere(&self, job: &Job) {
        self.touched.forget(job.id);
        if let Some((_, control)) = self.unfinished.remove(&job.id) {
            control.job.send_replace(shown(job));
        }
    }
}
