//! Results of a training as a version to store: objects, blocks and the report.

use std::time::Duration;

use palpate_schemas as wire;
use palpate_schemas::StartTraining;
use palpate_store::catalogue::{Draft, VersionObject, block_hash};
use palpate_store::model::TrainedModel;
use palpate_store::model_codec::APPEARANCE_BLOCK;
use uuid::Uuid;

use crate::clock::now_ms;
use crate::services::training::Trained;
use crate::wire as convert;
use crate::wire::training::VersionParameters;

/// The version of a job's training, which took `elapsed`.
pub(super) fn draft(
    job: Uuid,
    training: StartTraining,
    trained: Trained,
    blocks: Vec<(String, Vec<u8>)>,
    elapsed: Duration,
) -> Draft {
    let version_object =
        |object: &wire::ObjectReport| VersionObject { id: object.id, name: object.name.clone() };
    let objects: Vec<VersionObject> = trained.objects.iter().map(version_object).collect();
    let basis = trained.model.surface.as_ref().map(|surfaces| surfaces.calibration.basis);
    let uncalibrated_reason = basis.and_then(convert::evidence::reason);
    let calibrated_on = basis.map_or(0, convert::evidence::n_objects);
    let report = wire::TrainingReport {
        n_classes: convert::count(trained.model.sva.vocabulary.n_classes()),
        index_bytes: trained.objects.iter().map(|object| object.index_bytes).sum(),
        surface_bytes: trained.model.surface.as_ref().map_or(0, |model| model.bytes() as u64),
        seconds: elapsed.as_secs_f64(),
        seed: training.seed.unwrap_or_default(),
        appearance: appearance_summary(&trained.model, &objects, &blocks),
        calibrated: basis.map(|_| uncalibrated_reason.is_none()),
        calibrated_on: convert::count(calibrated_on),
        uncalibrated_reason,
        sensor_knowledge: trained.objects.iter().find_map(|object| object.sensor_knowledge),
        objects: trained.objects,
        skipped: trained.skipped,
        warnings: trained.warnings,
        recalibration: None,
    };
    let parameters = VersionParameters { training, report, merged_from: Vec::new() };
    Draft {
        job: Some(job),
        objects,
        shared: Vec::new(),
        blocks,
        created_at_ms: now_ms(),
        parameters: serde_json::to_string(&parameters)
            .expect("a report consists of finite numbers and strings"),
    }
}

/// Summary of the learnt appearance.
fn appearance_summary(
    model: &TrainedModel,
    objects: &[VersionObject],
    blocks: &[(String, Vec<u8>)],
) -> Option<wire::AppearanceSummary> {
    let (_, block) = blocks.iter().find(|(name, _)| name == APPEARANCE_BLOCK)?;
    let appearance = model.appearance.as_ref()?;
    Some(convert::appearance::summary(appearance, objects, &block_hash(block)))
}
