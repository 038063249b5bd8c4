//! Recalibrations as jobs: the request is checked on arrival with its sessions, which the job
//! replays at its turn.

use std::sync::Arc;

use palpate_schemas as wire;
use palpate_schemas::{JobStage, RecalibrateCatalogue};
use palpate_store::catalogue::{Catalogue, Draft};
use palpate_store::database::Database;
use palpate_store::entity::Job;
use palpate_store::model_codec::{CALIBRATION_BLOCK, ModelPart};
use uuid::Uuid;

use super::Jobs;
use super::control::Control;
use super::error::JobError;
use crate::asker::Asker;
use crate::clock::now_ms;
use crate::model::NoPart;
use crate::services::catalogues::CatalogueError;
use crate::services::recalibration::{Recalibrated, Sources, Target, choose, recalibrate};
use crate::services::sensors::Sensors;
use crate::services::training::TrainingFailure;
use crate::wire::recalibration::JobRequest;
use crate::wire::training::VersionParameters;

impl Jobs {
    /// Queues a recalibration.
    pub(crate) async fn start_recalibration(
        self: &Arc<Self>,
        catalogue: &str,
        request: RecalibrateCatalogue,
    ) -> Result<wire::Job, JobError> {
        let _using = self.catalogues.using().await;
        let catalogue = self.catalogues.find(catalogue)?;
        let version = self.catalogues.pin(&catalogue.name, request.version, None)?.version;
        let (target, _) = self.target(&catalogue, version)?;
        let (jobs, stop) = (Arc::clone(self), Asker::current().overdue().clone());
        let choosing = move || {
            let sources = Sources { store: &jobs.store, sensors: jobs.sensors.known() };
            choose(&target, &request, &sources, &stop).map(|sessions| (request, sessions))
        };
        let (request, sessions) = self.pool.place()?.run_long(choosing).await??;
        let n_sessions = sessions.len();
        let recalibration = RecalibrateCatalogue {
            version: Some(version),
            sessions: Some(sessions),
            activate: Some(request.activate.unwrap_or(true)),
            ..request
        };
        let request = JobRequest::Recalibration { recalibration };
        let job = self.queue(&catalogue.name, &request).await?;
        tracing::info!(job.id = %job.id,
            "Queued job {} for a recalibration by {n_sessions} sessions", job.id);
        Ok(job)
    }

    /// A version whose sessions can be replayed, and its parameters.
    pub(super) fn target(
        &self,
        catalogue: &Catalogue,
        version: u32,
    ) -> Result<(Target, VersionParameters), CatalogueError> {
        let (manifest, parameters) = self.catalogues.manifest_of(&catalogue.name, version)?;
        if !manifest.has(ModelPart::Surface) {
            let (part, catalogue) = (ModelPart::Surface, catalogue.name.clone());
            return Err(NoPart { part, catalogue, version }.into());
        }
        Ok((Target { catalogue: catalogue.clone(), manifest }, parameters))
    }

    /// Does a recalibration; the version that it made.
    pub(super) async fn recalibrate(
        &self,
        job: &Job,
        request: RecalibrateCatalogue,
        control: &Arc<Control>,
    ) -> Result<u32, TrainingFailure> {
        let catalogue = self.catalogues.find(&job.catalogue)?;
        let version = request.version.unwrap_or_default();
        let sessions = request.sessions.unwrap_or_default();
        let (target, parameters) = self.target(&catalogue, version)?;
        let model = self.catalogues.load(catalogue.id, version, ModelPart::Surface).await?;
        let (heard, named) = (Arc::clone(control), target.clone());
        let work = move |store: &Database, sensors: &Arc<Sensors>| {
            let sources = Sources { store, sensors: sensors.known() };
            let progress = |stage, done, total| heard.tell(stage, done, total);
            Ok(recalibrate(&named, &model, &sessions, &sources, &progress)?)
        };
        let found = self.on_threads(work).await?;
        if control.tell(JobStage::Storing, 0, 1).is_break() {
            return Err(TrainingFailure::Stopped);
        }
        let activate = request.activate.unwrap_or(true) && found.report.is_better;
        let draft = draft(job.id, &target, parameters, found);
        Ok(self.catalogues.publish_recalibrated(catalogue.id, version, draft, activate).await?)
    }
}

/// The recalibrated version: all blocks of the one before, and the new calibration.
fn draft(job: Uuid, target: &Target, before: VersionParameters, found: Recalibrated) -> Draft {
    let Recalibrated { block, report } = found;
    let report = wire::TrainingReport {
        calibrated: Some(true),
        calibrated_on: report.n_objects,
        uncalibrated_reason: None,
        recalibration: Some(report),
        ..before.report
    };
    let parameters = VersionParameters { report, ..before };
    let is_kept = |name: &str| name != CALIBRATION_BLOCK;
    let shared = target.manifest.blocks.iter().filter(|block| is_kept(&block.name));
    Draft {
        job: Some(job),
        objects: target.manifest.objects.clone(),
        shared: shared.cloned().collect(),
        blocks: vec![(CALIBRATION_BLOCK.to_owned(), block)],
        created_at_ms: now_ms(),
        parameters: serde_json::to_string(&parameters)
            .expect("a report consists of finite numbers and strings"),
    }
}
