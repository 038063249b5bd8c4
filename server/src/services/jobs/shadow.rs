//! Comparisons of two versions as jobs: the request is checked on arrival with its sessions, which
//! the job replays at its turn.

use std::sync::Arc;

use palpate_schemas as wire;
use palpate_schemas::ShadowVersion;
use palpate_store::database::Database;
use palpate_store::entity::Job;
use palpate_store::model_codec::ModelPart;

use super::Jobs;
use super::control::Control;
use super::error::JobError;
use crate::asker::Asker;
use crate::cause::Cause;
use crate::services::recalibration::Sources;
use crate::services::sensors::Sensors;
use crate::services::shadow::{Side, choose, compare};
use crate::services::training::TrainingFailure;
use crate::wire::recalibration::JobRequest;
use crate::wire::{Invalid, number};

/// Accepted risk at which a session counts as decided, by default: as in the examples of `risk`.
const RISK: f64 = 0.05;

impl Jobs {
    /// Queues a comparison of a version with another one.
    pub(crate) async fn start_shadow(
        self: &Arc<Self>,
        catalogue: &str,
        version: &str,
        request: ShadowVersion,
    ) -> Result<wire::Job, JobError> {
        let _using = self.catalogues.using().await;
        let risk = number("/risk", request.risk.unwrap_or(RISK), 0.0001, 0.5)?;
        let version = self.catalogues.version(catalogue, version)?.version;
        let catalogue = self.catalogues.find(catalogue)?;
        let against = self.against(&catalogue.name, request.against)?;
        if against == version {
            let detail = format!("came {against}, expected another version than the one to try");
            return Err(Invalid::field("/against", detail).into());
        }
        let (target, _) = self.target(&catalogue, version)?;
        self.target(&catalogue, against)?;
        let (store, stop) = (self.store.clone(), Asker::current().overdue().clone());
        let named = request.sessions.clone();
        let choosing = move || choose(&target, named.as_deref(), &store, &stop);
        let sessions = self.pool.place()?.run_long(choosing).await??;
        let n_sessions = sessions.len();
        let (against, sessions, risk) = (Some(against), Some(sessions), Some(risk));
        let shadow = ShadowVersion { against, sessions, risk };
        let job = self.queue(&catalogue.name, &JobRequest::Shadow { version, shadow }).await?;
        tracing::info!(job.id = %job.id,
            "Queued job {} for a comparison on {n_sessions} sessions", job.id);
        Ok(job)
    }

    /// The version to compare with: the named one, or the current one.
    fn against(&self, catalogue: &str, named: Option<u32>) -> Result<u32, JobError> {
        let pinned = self.catalogues.pin(catalogue, named, None).map_err(|error| match named {
            Some(_) => Cause::field("/against", error).into(),
            None => JobError::from(error),
        });
        Ok(pinned?.version)
    }

    /// Does a comparison.
    pub(super) async fn shadow(
        &self,
        job: &Job,
        version: u32,
        request: ShadowVersion,
        control: &Arc<Control>,
    ) -> Result<wire::ShadowReport, TrainingFailure> {
        let catalogue = self.catalogues.find(&job.catalogue)?;
        let against = request.against.unwrap_or_default();
        let risk = request.risk.unwrap_or(RISK);
        let sessions = request.sessions.unwrap_or_default();
        let old = self.target(&catalogue, against)?.0;
        let new = self.target(&catalogue, version)?.0;
        let part = ModelPart::Surface;
        let old_model = self.catalogues.load(catalogue.id, against, part).await?;
        let new_model = self.catalogues.load(catalogue.id, version, part).await?;
        let heard = Arc::clone(control);
        let work = move |store: &Database, sensors: &Arc<Sensors>| {
            let sources = Sources { store, sensors: sensors.known() };
            let progress = |stage, done, total| heard.tell(stage, done, total);
            let old = Side { target: &old, model: &old_model };
            let new = Side { target: &new, model: &new_model };
            Ok(compare(&old, &new, &sessions, risk, &sources, &progress)?)
        };
        self.on_threads(work).await
    }
}
