//! Conversion of appearance: trainings and reports.

use std::sync::Arc;

use palpate_core::object::ObjectIdx;
use palpate_dissertation::appearance::model::{
    AppearanceModel, AppearanceSource, ObjectAppearance,
};
use palpate_dissertation::appearance::train::{
    AppearanceConfig, ClusteringMethod, DiscriminantConfig,
};
use palpate_schemas as wire;
use palpate_schemas::{AppearanceTraining, ClusteringKind, Descriptor, FeatureSource};
use palpate_store::catalogue::VersionObject;

use crate::wire::Invalid;
use crate::wire::{count, descriptor, number, within};

/// Maximum number of candidates for the number of classes.
const CANDIDATES_MAX: usize = 10;
/// Maximum number of classes of a candidate.
const CLASSES_MAX: u64 = 400;
/// Shrinkage of the covariance within objects for discriminant axes.
const SHRINKAGE: f64 = 0.1;

/// A training's appearance with every default filled in, its numbers checked.
pub(crate) fn training(request: &AppearanceTraining) -> Result<AppearanceTraining, Invalid> {
    let default = AppearanceConfig::default();
    let source = request.source.unwrap_or_default();
    if source == FeatureSource::Features && request.descriptor.is_some() {
        let detail = "came with the source `features`, expected with `images` only";
        return Err(Invalid::field("/appearance/descriptor", detail));
    }
    let is_images = source == FeatureSource::Images;
    let share = request.variance_share.unwrap_or(default.variance_share);
    let candidates = request
        .n_classes
        .clone()
        .unwrap_or_else(|| default.n_classes.iter().map(|n| count(*n)).collect());
    if !(1..=CANDIDATES_MAX).contains(&candidates.len()) {
        let found = candidates.len();
        let detail = format!("{found} candidates came, expected 1 to {CANDIDATES_MAX}");
        return Err(Invalid::field("/appearance/n_classes", detail));
    }
    for (place, n_classes) in candidates.iter().enumerate() {
        let at = format!("/appearance/n_classes/{place}");
        within(&at, u64::from(*n_classes), 2, CLASSES_MAX)?;
    }
    if let Some(n_axes) = request.discriminant_axes {
        within("/appearance/discriminant_axes", u64::from(n_axes), 1, 1000)?;
    }
    let n_readings = request.report_readings.unwrap_or_else(|| count(default.report_readings));
    Ok(AppearanceTraining {
        source: Some(source),
        descriptor: is_images.then(|| request.descriptor.unwrap_or(Descriptor::Mnti)),
        variance_share: Some(number("/appearance/variance_share", share, 0.5, 1.0)?),
        clustering: Some(request.clustering.unwrap_or_default()),
        n_classes: Some(candidates),
        discriminant_axes: request.discriminant_axes,
        report_readings: Some(count(within(
            "/appearance/report_readings",
            u64::from(n_readings),
            1,
            1000,
        )?)),
    })
}

/// Core's configuration of a training's appearance that was checked.
pub(crate) fn config(training: &AppearanceTraining) -> AppearanceConfig {
    let default = AppearanceConfig::default();
    let candidates = training.n_classes.as_ref();
    AppearanceConfig {
        descriptor: training.descriptor.map_or(default.descriptor, descriptor::from_wire),
        variance_share: training.variance_share.unwrap_or(default.variance_share),
        discriminant: training
            .discriminant_axes
            .map(|n| DiscriminantConfig { n_axes: n as usize, shrinkage: SHRINKAGE }),
        clustering: match training.clustering.unwrap_or_default() {
            ClusteringKind::Mixture => ClusteringMethod::Mixture,
            ClusteringKind::SharedMixture => ClusteringMethod::SharedMixture,
            ClusteringKind::PerObject => ClusteringMethod::PerObject,
            ClusteringKind::KMeans => ClusteringMethod::KMeans,
        },
        n_classes: candidates
            .map_or(default.n_classes, |all| all.iter().map(|n| *n as usize).collect()),
        report_readings: training.report_readings.map_or(default.report_readings, |n| n as usize),
        ..default
    }
}

/// Summary of the learnt appearance. `vocabulary` is the hash of its block.
pub(crate) fn summary(
    model: &AppearanceModel,
    objects: &[VersionObject],
    vocabulary: &[u8; 32],
) -> wire::AppearanceSummary {
    wire::AppearanceSummary {
        vocabulary: vocabulary_name(vocabulary),
        n_components: count(model.vocabulary.clustering.dimension()),
        n_classes: count(model.vocabulary.n_classes()),
        n_readings: count(model.report.n_readings),
        accuracy: model.report.accuracy,
        warnings: warnings(model, objects),
    }
}

/// Report on a version from its held-out readings.
pub(crate) fn report(
    model: &AppearanceModel,
    objects: &[VersionObject],
    vocabulary: &[u8; 32],
    catalogue: &str,
    version: u32,
) -> wire::AppearanceReport {
    let (classes, report) = (&model.vocabulary, &model.report);
    let (source, descriptor) = match classes.source {
        AppearanceSource::Image { descriptor, .. } => {
            (FeatureSource::Images, Some(descriptor::to_wire(descriptor)))
        }
        AppearanceSource::External { .. } => (FeatureSource::Features, None),
    };
    let of_object =
        |(object, part): (&VersionObject, &std::sync::Arc<_>)| object_part(object, part);
    wire::AppearanceReport {
        catalogue: catalogue.to_owned(),
        version,
        vocabulary: vocabulary_name(vocabulary),
        source,
        descriptor,
        feature_length: count(classes.pca.dimension()),
        n_components: count(classes.clustering.dimension()),
        n_classes: count(classes.n_classes()),
        candidates: classes
            .choices
            .iter()
            .map(|choice| wire::ClassCandidate {
                n_classes: count(choice.n_classes),
                accuracy: choice.accuracy,
                reliability: choice.reliability,
            })
            .collect(),
        exponent: model.exponent,
        n_readings: count(report.n_readings),
        accuracy: report.accuracy,
        objects: objects.iter().zip(&model.objects).map(of_object).collect(),
        confusion: report.confusion.clone(),
        affinity: report.affinity.clone(),
        near_duplicates: near_duplicates(model, objects),
        warnings: warnings(model, objects),
    }
}

fn object_part(object: &VersionObject, part: &Arc<ObjectAppearance>) -> wire::ObjectAppearance {
    wire::ObjectAppearance {
        id: object.id,
        name: object.name.clone(),
        // A reading has mass 1 but for rounding.
        n_readings: count(part.histogram.total().round() as u64),
        n_held_back: count(part.held_back.len()),
        histogram: part.histogram.mass.clone(),
    }
}

fn near_duplicates(model: &AppearanceModel, objects: &[VersionObject]) -> Vec<wire::NearDuplicate> {
    let name = |object: ObjectIdx| objects[object.0 as usize].name.clone();
    let pairs = model.report.near_duplicates.iter();
    pairs
        .map(|pair| wire::NearDuplicate {
            first: name(pair.first),
            second: name(pair.second),
            affinity: pair.affinity,
        })
        .collect()
}

fn warnings(model: &AppearanceModel, objects: &[VersionObject]) -> Vec<String> {
    let alike = near_duplicates(model, objects).into_iter().map(|pair| {
        format!(
            "{:?} and {:?} are nearly the same to the touch (affinity {:.3}): expect them to be \
             taken for each other",
            pair.first, pair.second, pair.affinity
        )
    });
    let unproven = objects.iter().zip(&model.objects).filter(|(_, part)| part.held_back.is_empty());
    let unproven = unproven.map(|(object, _)| {
        let name = &object.name;
        format!("{name:?} has too few readings to hold any back: the report does not test it")
    });
    alike.chain(unproven).collect()
}

/// The name of a vocabulary: the first digits of its block's hash.
fn vocabulary_name(hash: &[u8; 32]) -> String {
    hash[..16].iter().map(|byte| format!("{byte:02x}")).collect()
}
