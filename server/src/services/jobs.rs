//! Jobs, which are trainings and recalibrations: run one at a time, in the order of their requests,
//! by a separate worker.
//!
//! Robots in a session therefore do not wait for them. The store has each job's state; the
//! progress of the running one is in memory and streamed. A job interrupted by a stop of the
//! server goes on after it (`interruption`); its request makes it the same work. Servers that share
//! a store divide the jobs among them (`elsewhere`).

mod control;
mod draft;
mod elsewhere;
mod ending;
pub(crate) mod error;
mod interruption;
mod plan;
mod recalibration;
mod shadow;
mod work;

use std::sync::Arc;
use std::time::Duration;

use control::{CANCEL, Control, LOST, OVERDUE, SUSPEND};
use dashmap::DashMap;
use ending::Ending;
use interruption::Touched;
use palpate_schemas as wire;
use palpate_schemas::StartTraining;
use palpate_store::database::Database;
use palpate_store::engine::EngineError;
use palpate_store::engine::lease::Lease;
use palpate_store::entity::{Job, JobState};
use palpate_store::error::StoreError;
use tokio::sync::{Notify, watch};
use uuid::Uuid;

use crate::asker;
use crate::cause::Cause;
use crate::client::Client;
use crate::clock::now_ms;
use crate::compute::Pool;
use crate::config::Config;
use crate::notices::Notices;
use crate::services::catalogues::Catalogues;
use crate::services::objects::Objects;
use crate::services::sensors::Sensors;
use crate::services::training::TrainingFailure;
use crate::wire::recalibration::JobRequest;
use crate::wire::training::job as shown;
use crate::wire::webhook::finished_job;
use crate::wire::{self as convert, cursor, page_id, page_length};
use error::JobError;

/// Time for which a cancellation waits for the running training to notice.
const CANCEL_PATIENCE: Duration = Duration::from_secs(5);
/// Interval at which jobs of other servers are looked at. Chosen: a fraction of the time for which
/// a server that died still counts as their worker.
const LOOK_EVERY: Duration = Duration::from_secs(2);
/// All jobs.
pub(crate) struct Jobs {
    store: Database,
    notices: Arc<Notices>,
    objects: Arc<Objects>,
    sensors: Arc<Sensors>,
    catalogues: Arc<Catalogues>,
    threads: rayon::ThreadPool,
    /// For checks of requests that take long.
    pool: Pool,
    unfinished: DashMap<Uuid, Arc<Control>>,
    wake: Notify,
    starting: tokio::sync::Mutex<()>,
    queue_max: usize,
    /// Time limit of a training.
    within: Duration,
    /// Limit on the memory of a training, bytes.
    memory_max: u64,
    training_threads: usize,
    /// Bytes that one key may hold.
    quota: Option<u64>,
    touched: Touched,
}

impl Jobs {
    pub(crate) fn new(
        store: Database,
        notices: Arc<Notices>,
        objects: Arc<Objects>,
        sensors: Arc<Sensors>,
        catalogues: Arc<Catalogues>,
        pool: Pool,
        config: &Config,
    ) -> Result<Self, rayon::ThreadPoolBuildError> {
        let threads = rayon::ThreadPoolBuilder::new()
            .num_threads(config.training_threads.max(1))
            .thread_name(|thread| format!("training-{thread}"))
            .build()?;
        Ok(Self {
            store,
            notices,
            objects,
            sensors,
            catalogues,
            threads,
            pool,
            unfinished: DashMap::new(),
            wake: Notify::new(),
            starting: tokio::sync::Mutex::new(()),
            queue_max: config.training_queue_max.max(1),
            within: config.training_time_max,
            memory_max: config.training_memory_bytes_max,
            training_threads: config.training_threads.max(1),
            quota: config.store_quota_bytes,
            touched: Touched::in_folder(config.data.join("touches")),
        })
    }

    /// Resumes the jobs left by a stop of the server.
    pub(crate) async fn resume(&self) -> Result<(), StoreError> {
        for job in self.store.jobs().list_whole(None, usize::MAX - 1)?.items {
            let job = match job.state {
                JobState::Queued => job,
                // Another server may work on it.
                JobState::Running if self.store.is_shared() => job,
                JobState::Running => match self.after_interruption(job).await {
                    Ok(Some(job)) => job,
                    Ok(None) => continue,
                    // Reads go on with a full disk; the next start resumes it.
                    Err(StoreError::Engine(error @ EngineError::Full { .. })) => {
                        tracing::error!("Cannot take up an interrupted job: {error}");
                        continue;
                    }
                    Err(error) => return Err(error),
                },
                JobState::Succeeded | JobState::Failed | JobState::Cancelled => continue,
            };
            self.unfinished.insert(job.id, Arc::new(Control::new(shown(&job))));
        }
        let unfinished: Vec<Uuid> = self.unfinished.iter().map(|entry| *entry.key()).collect();
        self.touched.forget_all_but(&unfinished);
        self.wake.notify_one();
        Ok(())
    }

    /// Queues a training.
    pub(crate) async fn start(
        &self,
        catalogue: &str,
        request: &StartTraining,
    ) -> Result<wire::Job, JobError> {
        let _using = (self.sensors.using().await, self.catalogues.using().await);
        let training = self.checked(catalogue, request)?;
        let n_objects = training.objects.as_ref().map_or(0, Vec::len);
        let job = self.queue(catalogue, &JobRequest::Training(Box::new(training))).await?;
        tracing::info!(job.id = %job.id, "Queued job {} for {n_objects} objects", job.id);
        Ok(job)
    }

    /// Queues a checked request; creates its catalogue if it does not exist.
    async fn queue(&self, catalogue: &str, request: &JobRequest) -> Result<wire::Job, JobError> {
        let _starting = self.starting.lock().await;
        if self.unfinished.len() >= self.queue_max {
            return Err(JobError::QueueFull { waiting: self.unfinished.len() });
        }
        let catalogue = self.catalogues.find_or_create(catalogue).await?;
        let job = Job {
            id: Uuid::now_v7(),
            catalogue: catalogue.name,
            request: serde_json::to_string(request).expect("a checked request can be written"),
            state: JobState::Queued,
            stage: String::new(),
            done: 0,
            total: 0,
            cancel_requested: false,
            version: None,
            error: None,
            report: None,
            created_at_ms: now_ms(),
            started_at_ms: None,
            finished_at_ms: None,
        };
        self.store.jobs().create(&job).await?;
        self.unfinished.insert(job.id, Arc::new(Control::new(shown(&job))));
        self.wake.notify_one();
        Ok(shown(&job))
    }

    pub(crate) fn get(&self, id: &str) -> Result<wire::Job, Cause> {
        Ok(self.show(&self.find(id)?))
    }

    pub(crate) fn list(&self, query: &wire::PageQuery) -> Result<wire::JobPage, Cause> {
        let page = self.store.jobs().list_whole(page_id(query)?, page_length(query)?)?;
        let items = page.items.iter().map(|job| self.show(job)).collect();
        Ok(wire::JobPage { items, next_cursor: cursor(page.next) })
    }

    /// Cancels a job; a running one gets some time to notice.
    pub(crate) async fn cancel(&self, id: &str) -> Result<wire::Job, JobError> {
        let job = self.find(id)?;
        let Some(control) = self.control(job.id) else {
            return Err(finished(&self.find(id)?));
        };
        let mut news = control.job.subscribe();
        let table = self.store.jobs();
        let cancelled = table.update(job.id, |now| match now.state {
            JobState::Queued => {
                now.state = JobState::Cancelled;
                now.error = Some("it was cancelled before it began".to_owned());
                now.finished_at_ms = Some(now_ms());
                Ok(())
            }
            JobState::Running => {
                now.cancel_requested = true;
                Ok(())
            }
            JobState::Succeeded | JobState::Failed | JobState::Cancelled => Err(finished(now)),
        });
        let job = cancelled.await??;
        control.order(CANCEL);
        if job.state.is_final() {
            self.conclude(&job);
        } else {
            let ended = news.wait_for(|job| job.state.is_final());
            let _ = tokio::time::timeout(CANCEL_PATIENCE, ended).await;
        }
        Ok(self.get(id)?)
    }

    /// Deletes an ended job. The version it created stays.
    pub(crate) async fn delete(&self, id: &str) -> Result<(), Cause> {
        let job = self.find(id)?;
        if self.control(job.id).is_some() || !job.state.is_final() {
            let what = format!("job {}", job.id);
            let by = "it has not ended: cancel it first".to_owned();
            return Err(Cause::Needed { what, by });
        }
        self.store.essential().jobs().remove(job.id).await?;
        Ok(())
    }

    /// The job's present state and later ones.
    pub(crate) fn follow(&self, id: &str) -> Result<watch::Receiver<wire::Job>, Cause> {
        let job = self.find(id)?;
        Ok(match self.control(job.id) {
            Some(control) => control.job.subscribe(),
            None => watch::channel(self.get(id)?).1,
        })
    }

    /// Runs jobs until the server stops; a running one is then suspended.
    pub(crate) async fn work(self: Arc<Self>, mut stopping: watch::Receiver<bool>) {
        loop {
            let next = match self.next().await {
                Ok(next) => next,
                Err(error) => {
                    tracing::error!("Cannot read the queue of jobs: {error}");
                    None
                }
            };
            let Some((job, lease)) = next else {
                // The worker of a job of another server may be gone.
                let looks_again = self.store.is_shared() && !self.unfinished.is_empty();
                tokio::select! {
                    () = self.wake.notified() => continue,
                    () = tokio::time::sleep(LOOK_EVERY), if looks_again => continue,
                    _ = stopping.wait_for(|stopping| *stopping) => return,
                }
            };
            let (id, working) = (job.id, self.run((job, lease), stopping.clone()));
            tokio::pin!(working);
            let is_stopped = tokio::select! {
                () = &mut working => continue,
                _ = stopping.wait_for(|stopping| *stopping) => true,
            };
            if is_stopped {
                if let Some(control) = self.control(id) {
                    control.order(SUSPEND);
                }
                working.await;
                return;
            }
        }
    }

    /// Number of unfinished jobs.
    pub(crate) fn n_unfinished(&self) -> usize {
        self.unfinished.len()
    }

    fn find(&self, id: &str) -> Result<Job, Cause> {
        let unknown = || Cause::unknown("job", id);
        let uuid = Uuid::parse_str(id).map_err(|_| unknown())?;
        self.store.jobs().find(uuid)?.ok_or_else(unknown)
    }

    fn control(&self, id: Uuid) -> Option<Arc<Control>> {
        self.unfinished.get(&id).map(|control| Arc::clone(&control))
    }

    fn show(&self, job: &Job) -> wire::Job {
        match self.control(job.id) {
            Some(control) if !job.state.is_final() => control.job.borrow().clone(),
            _ => shown(job),
        }
    }

    async fn run(self: &Arc<Self>, (job, lease): (Job, Lease), stopping: watch::Receiver<bool>) {
        let id = job.id;
        let Some(control) = self.control(id) else { return };
        control.hold(lease);
        // Records of a training count towards the key that requested it.
        let client = self.store.job_writer(id).ok().flatten().filter(|key| !key.is_nil());
        let trained = asker::ask(client.map(Client::Key), self.work_on(&job, &control)).await;
        let mut report = None;
        let (state, version, reason) = match trained {
            Ok(done) => {
                report = done.report;
                (JobState::Succeeded, Some(done.version), None)
            }
            Err(TrainingFailure::Stopped) if control.is_ordered(LOST) => {
                control.release();
                return tracing::error!(job.id = %id,
                    "Stopped job {id}: the store was out of reach, another server may have it");
            }
            Err(TrainingFailure::Stopped) if control.is_ordered(SUSPEND) => {
                self.suspended(id).await;
                return control.release();
            }
            Err(TrainingFailure::Stopped) if control.is_ordered(OVERDUE) => {
                let within = self.within.as_secs();
                let reason = format!(
                    "it took longer than {within} s, which is what a job may take: train fewer \
                     objects or readings, replay fewer sessions, or start the server with \
                     `--training-max-s`"
                );
                (JobState::Failed, None, Some(reason))
            }
            Err(TrainingFailure::Stopped) => {
                (JobState::Cancelled, None, Some("it was cancelled while it ran".to_owned()))
            }
            Err(failure) => (JobState::Failed, None, Some(failure.to_string())),
        };
        let ending = Ending { id, state, version, reason, report, at_ms: now_ms() };
        self.end(ending, &stopping).await;
    }

    /// Notifies the followers of a finished job, and forgets it.
    fn conclude(&self, job: &Job) {
        metrics::counter!("palpate_jobs_total", "state" => format!("{:?}", job.state)).increment(1);
        self.touched.forget(job.id);
        let reason = job.error.as_deref().unwrap_or("as asked");
        tracing::info!(job.id = %job.id, "Job {} ended {:?}: {reason}", job.id, job.state);
        if let Some((_, control)) = self.unfinished.remove(&job.id) {
            control.job.send_replace(shown(job));
            control.release();
        }
        if let Some((at_ms, job)) = finished_job(job) {
            self.notices.job(at_ms, job);
        }
    }
}

fn finished(job: &Job) -> JobError {
    JobError::Finished { job: job.id, state: convert::training::state(job.state) }
}
