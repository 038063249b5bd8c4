//! The work of a running job, on the training threads, and its result as a version.

use std::sync::Arc;
use std::time::Instant;

use palpate_schemas::{JobStage, StartTraining};
use palpate_store::database::Database;
use palpate_store::entity::{Job, JobState};
use palpate_store::model_codec::model_to_blocks;
use tokio::sync::oneshot;
use uuid::Uuid;

use super::Jobs;
use super::control::Control;
use super::draft::draft;
use crate::cause::Cause;
use crate::clock::now_ms;
use crate::services::sensors::Sensors;
use crate::services::training::{Sources, TrainingFailure, train};
use crate::wire::recalibration::JobRequest;
use crate::wire::training::job as shown;

/// What a job made or tried, and what it found.
pub(super) struct Done {
    pub(super) version: u32,
    pub(super) report: Option<String>,
}

impl Jobs {
    /// Does a job.
    pub(super) async fn work_on(
        &self,
        job: &Job,
        control: &Arc<Control>,
    ) -> Result<Done, TrainingFailure> {
        let table = self.store.jobs();
        let marked = table.update(job.id, |now| {
            if now.state != JobState::Queued {
                return Err(TrainingFailure::Stopped);
            }
            now.state = JobState::Running;
            now.started_at_ms = Some(now_ms());
            Ok(())
        });
        let job = marked.await??;
        control.job.send_replace(shown(&job));
        control.begin(self.within);
        tracing::info!(job.id = %job.id, "Started job {}", job.id);
        let request: JobRequest = serde_json::from_str(&job.request).map_err(|error| {
            Cause::Unusable { what: "job", id: job.id.to_string(), reason: error.to_string() }
        })?;
        let version = match request {
            JobRequest::Training(training) => self.train(&job, *training, control).await?,
            JobRequest::Recalibration { recalibration } => {
                self.recalibrate(&job, recalibration, control).await?
            }
            JobRequest::Shadow { version, shadow } => {
                let report = self.shadow(&job, version, shadow, control).await?;
                let report = serde_json::to_string(&report);
                let report = Some(report.expect("a report consists of finite numbers and names"));
                return Ok(Done { version, report });
            }
        };
        Ok(Done { version, report: None })
    }

    async fn train(
        &self,
        job: &Job,
        training: StartTraining,
        control: &Arc<Control>,
    ) -> Result<u32, TrainingFailure> {
        let started = Instant::now();
        let plan = self.plan(&job.catalogue, &training).await?;
        let (heard, keeping) = (Arc::clone(control), self.keeping(job.id));
        let work = move |store: &Database, sensors: &Arc<Sensors>| {
            let sources = Sources { store, sensors, keeping: keeping.as_ref() };
            let progress = |stage, done, total| heard.tell(stage, done, total);
            let trained = train(&plan, &sources, &progress)?;
            let ids: Vec<Uuid> = trained.objects.iter().map(|object| object.id).collect();
            let blocks = model_to_blocks(&trained.model, &ids);
            Ok((trained, blocks))
        };
        let (trained, blocks) = self.on_threads(work).await?;
        if control.tell(JobStage::Storing, 0, 1).is_break() {
            return Err(TrainingFailure::Stopped);
        }
        let activate = training.activate.unwrap_or(true);
        let draft = draft(job.id, training, trained, blocks, started.elapsed());
        Ok(self.catalogues.publish(&job.catalogue, draft, activate).await?)
    }

    /// Works on the training threads.
    pub(super) async fn on_threads<T: Send + 'static>(
        &self,
        work: impl FnOnce(&Database, &Arc<Sensors>) -> Result<T, TrainingFailure> + Send + 'static,
    ) -> Result<T, TrainingFailure> {
        let (answer, answered) = oneshot::channel();
        let (store, sensors) = (self.store.clone(), Arc::clone(&self.sensors));
        self.threads.spawn(move || {
            let working = std::panic::AssertUnwindSafe(|| work(&store, &sensors));
            let outcome = std::panic::catch_unwind(working);
            // The receiver of the answer may close the store.
            drop((store, sensors));
            // The receiver is gone when the runtime is.
            let _ = answer.send(outcome.unwrap_or(Err(Cause::Panicked.into())));
        });
        answered.await.unwrap_or(Err(Cause::Panicked.into()))
    }
}
