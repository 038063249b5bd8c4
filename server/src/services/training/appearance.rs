//! Training of appearance classes and histograms.
//!
//! A training that extends a version uses its vocabulary and keeps its objects' histograms;
//! the exponent and the report are recomputed from the held-out readings of all objects.

use std::ops::ControlFlow;
use std::sync::Arc;

use palpate_dissertation::appearance::model::{
    AppearanceModel, AppearanceVocabulary, ObjectAppearance,
};
use palpate_dissertation::appearance::train::{
    AppearanceConfig, AppearanceSet, AppearanceTrainError, appearance_model,
    learn_appearance_vocabulary_with_progress, object_histogram,
};
use palpate_schemas::{FeatureSource, JobStage};

use super::base::extended;
use super::material::Material;
use super::{Plan, Progress, TrainingFailure, step};

/// Configuration of appearance.
pub(crate) struct AppearancePlan {
    pub(crate) config: AppearanceConfig,
    pub(crate) source: FeatureSource,
}

/// Learns the appearance of all objects of the new version.
pub(super) fn learn(
    plan: &Plan,
    settings: &AppearancePlan,
    materials: &[Material],
    progress: &Progress<'_>,
) -> Result<AppearanceModel, TrainingFailure> {
    let config = &settings.config;
    let sets = sets(settings, materials)?;
    let known = plan.base.as_ref().map(|base| base.model.appearance()).transpose()?;
    let n_candidates = if known.is_some() { 0 } else { config.n_classes.len() };
    let total = n_candidates + materials.len();
    let tell = |n_done: usize| progress(JobStage::Appearance, n_done, total);
    step(progress, JobStage::Appearance, 0, total)?;
    let vocabulary = match known {
        Some(model) => Arc::clone(&model.vocabulary),
        None => Arc::new(vocabulary(plan, config, &sets, &tell)?),
    };
    let mut objects: Vec<Arc<ObjectAppearance>> = Vec::with_capacity(materials.len());
    for (material, set) in materials.iter().zip(&sets) {
        let object = object_histogram(set, &vocabulary, config).map_err(|source| {
            TrainingFailure::Appearance { object: material.object.name.clone(), source }
        })?;
        objects.push(Arc::new(object));
        step(progress, JobStage::Appearance, n_candidates + objects.len(), total)?;
    }
    if let (Some(base), Some(known)) = (&plan.base, known) {
        objects = extended(&known.objects, &base.places(materials), objects);
    }
    Ok(appearance_model(vocabulary, objects, config, plan.seed))
}

fn vocabulary(
    plan: &Plan,
    config: &AppearanceConfig,
    sets: &[AppearanceSet<'_>],
    tell: &(dyn Fn(usize) -> ControlFlow<()> + Sync),
) -> Result<AppearanceVocabulary, TrainingFailure> {
    learn_appearance_vocabulary_with_progress(sets, config, plan.seed, tell).map_err(|error| {
        match error {
            AppearanceTrainError::Stopped => TrainingFailure::Stopped,
            other => other.into(),
        }
    })
}

/// Training data of each object: its readings, or the features sent with them.
fn sets<'a>(
    settings: &AppearancePlan,
    materials: &'a [Material],
) -> Result<Vec<AppearanceSet<'a>>, TrainingFailure> {
    let mut sets = Vec::with_capacity(materials.len());
    let mut expected = None;
    for material in materials {
        let object = || material.object.name.clone();
        if settings.source == FeatureSource::Images {
            sets.push(AppearanceSet::Readings(material.set()));
            continue;
        }
        let Some(first) = material.features.first() else {
            return Err(TrainingFailure::NoFeatures { object: object() });
        };
        let (found, expected) = (first.len(), *expected.get_or_insert(first.len()));
        if found != expected {
            return Err(TrainingFailure::FeatureLength { object: object(), expected, found });
        }
        sets.push(AppearanceSet::Features(&material.features));
    }
    Ok(sets)
}
