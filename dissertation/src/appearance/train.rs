//! Training of appearance: a vocabulary, a histogram for each object, and a report.
//!
//! Source: sections 4.3.1.1.1 and 4.4.2.1; reductions, smoothing and bounds as in
//! `docs/equations.md`. A share of every set's readings is held out: they choose the number
//! of classes, calibrate the exponent and make the report, and no histogram contains them.

mod features;
mod trials;

use std::ops::ControlFlow;
use std::sync::Arc;

use rayon::prelude::*;
use thiserror::Error;

use crate::appearance::model::{
    AppearanceModel, AppearanceVocabulary, ObjectAppearance, ObjectShares, ReadingClasses,
};
use features::{Split, source_of, split};
use palpate_core::descriptor::{DescriptorKind, FeatureMatrix};
use palpate_core::training::TrainingSet;
use palpate_core::vocabulary::bag::{ClassHistogram, Clustering, joint_shares};
use palpate_core::vocabulary::choice::{ClassCount, best_class_count};
use palpate_core::vocabulary::discriminant::{Discriminant, find_discriminants};
use palpate_core::vocabulary::gmm::{Covariances, MixtureConfig, MixtureError, fit_mixture_while};
use palpate_core::vocabulary::kmeans::{KMeansConfig, k_means};
use palpate_core::vocabulary::labelled::labelled_mixture;
use palpate_core::vocabulary::pca::{Keep, Pca, PcaError};
pub use trials::{CONFUSED_SHARE, NEAR_DUPLICATE};
use trials::{count, fit_exponent, report};

/// Clustering of the classes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClusteringMethod {
    /// k-means: hard classes.
    KMeans,
    /// A Gaussian mixture with full covariances: soft classes.
    Mixture,
    /// A Gaussian mixture with one covariance for all, beyond print: for few readings.
    SharedMixture,
    /// One Gaussian for each training object, beyond print; ignores `n_classes`.
    PerObject,
}

/// Search for discriminant axes, beyond the dissertation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DiscriminantConfig {
    /// At most this many axes.
    pub n_axes: usize,
    /// Shrinkage of the covariance within objects towards the identity, 0 to 1.
    pub shrinkage: f64,
}

/// Configuration of training.
#[derive(Clone, Debug, PartialEq)]
pub struct AppearanceConfig {
    /// Descriptor of the images; clients' own features need none.
    pub descriptor: DescriptorKind,
    /// Share of the variance in the principal components that are kept.
    pub variance_share: f64,
    /// Discriminant axes after the principal components; `None` as printed.
    pub discriminant: Option<DiscriminantConfig>,
    /// Clustering of the classes.
    pub clustering: ClusteringMethod,
    /// Candidates for the number of classes; the held-out readings choose.
    pub n_classes: Vec<usize>,
    /// Independent starts of a clustering.
    pub n_starts: usize,
    /// Number of readings added to every class of a histogram: 1 is 1/n of an object's n readings.
    pub smoothing: f64,
    /// Share of every object's readings that is held out.
    pub held_back_share: f64,
    /// Number of held-out readings in a trial of the report.
    pub report_readings: usize,
}

impl Default for AppearanceConfig {
    /// The settings of `docs/equations.md`.
    fn default() -> Self {
        Self {
            descriptor: DescriptorKind::Mnti,
            variance_share: 0.99,
            discriminant: None,
            clustering: ClusteringMethod::Mixture,
            n_classes: vec![48],
            n_starts: 4,
            smoothing: 1.0,
            held_back_share: 0.2,
            report_readings: 20,
        }
    }
}

/// Training data of one object's appearance.
#[derive(Clone, Copy, Debug)]
pub enum AppearanceSet<'a> {
    /// Readings; their poses are not used.
    Readings(TrainingSet<'a>),
    /// The clients' own features, one per reading.
    Features(&'a [Vec<f64>]),
}

/// Error of data from which appearance cannot be learnt.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum AppearanceTrainError {
    /// No reading touched an object.
    #[error("no training reading touched anything, expected at least one")]
    NothingTouched,
    /// A number of the configuration is out of range.
    #[error("{field} is {found}, expected {low} to {high}")]
    Range {
        /// The field.
        field: &'static str,
        /// The given value.
        found: f64,
        /// The smallest permitted value.
        low: f64,
        /// The largest permitted value.
        high: f64,
    },
    /// There is no candidate for the number of classes.
    #[error("n_classes is empty, expected at least one candidate")]
    NoCandidate,
    /// An image has another shape than the vocabulary's.
    #[error("image of {found_rows}×{found_cols} taxels, expected {rows}×{cols}")]
    Shape {
        /// Rows of the vocabulary's images.
        rows: usize,
        /// Columns of the vocabulary's images.
        cols: usize,
        /// Rows of the image.
        found_rows: usize,
        /// Columns of the image.
        found_cols: usize,
    },
    /// A feature has another length, or a value that is not finite.
    #[error("feature {feature} is not {dimension} finite numbers like the others")]
    Feature {
        /// The first such feature of its set.
        feature: usize,
        /// The length of the others.
        dimension: usize,
    },
    /// The features do not vary, or are too few.
    #[error(transparent)]
    Pca(#[from] PcaError),
    /// The features do not vary within objects, so that no class has a width.
    #[error(transparent)]
    Mixture(#[from] MixtureError),
    /// The progress function stopped the training.
    #[error("learning was told to stop")]
    Stopped,
    /// The sets mix images and clients' own features.
    #[error("some sets are readings and others are features, expected one kind")]
    MixedSources,
}

/// Maximum number of classes that can be requested.
pub const MAX_APPEARANCE_CLASSES: usize = 1_000;

/// Progress function: receives the number of finished candidates for the number of classes,
/// often, and may stop the training.
pub type Progress<'a> = dyn Fn(usize) -> ControlFlow<()> + Sync + 'a;

/// Learns the classes from the readings of all objects together.
///
/// # Errors
/// [`AppearanceTrainError`] when the configuration is out of range, nothing was touched, or
/// the sets do not fit each other.
pub fn learn_appearance_vocabulary(
    sets: &[AppearanceSet<'_>],
    config: &AppearanceConfig,
    seed: u64,
) -> Result<AppearanceVocabulary, AppearanceTrainError> {
    learn_appearance_vocabulary_with_progress(sets, config, seed, &|_| ControlFlow::Continue(()))
}

/// Like [`learn_appearance_vocabulary`], with a progress function.
///
/// # Errors
/// The same, and [`AppearanceTrainError::Stopped`].
pub fn learn_appearance_vocabulary_with_progress(
    sets: &[AppearanceSet<'_>],
    config: &AppearanceConfig,
    seed: u64,
    progress: &Progress<'_>,
) -> Result<AppearanceVocabulary, AppearanceTrainError> {
    check(config)?;
    let source = source_of(sets, config.descriptor)?;
    let splits: Vec<Split> = sets
        .iter()
        .map(|set| split(set, source, config.held_back_share))
        .collect::<Result<_, _>>()?;
    let all: Vec<Vec<f64>> =
        splits.iter().flat_map(Split::training_features).map(<[f64]>::to_vec).collect();
    let matrix = FeatureMatrix::from_rows(&all).ok_or(AppearanceTrainError::NothingTouched)?;
    let pca = Pca::fit(&matrix, Keep::Share(config.variance_share))?;
    let discriminant = config.discriminant.and_then(|settings| {
        let project =
            |split: &Split| split.training_features().map(|f| pca.project_one(f)).collect();
        let objects: Vec<Vec<Vec<f64>>> = splits.par_iter().map(project).collect();
        find_discriminants(&objects, settings.n_axes, settings.shrinkage)
    });
    let reduce_all = |split: &Split| -> Vec<Vec<f64>> {
        split.training_features().map(|f| reduce(&pca, discriminant.as_ref(), f)).collect()
    };
    let reduced: Vec<Vec<Vec<f64>>> = splits.par_iter().map(reduce_all).collect();
    let mut best: Option<AppearanceVocabulary> = None;
    let mut choices: Vec<ClassCount> = Vec::new();
    for n_classes in &config.n_classes {
        let n_done = choices.len();
        let go_on = || progress(n_done).is_continue();
        let vocabulary = AppearanceVocabulary {
            source,
            pca: pca.clone(),
            discriminant: discriminant.clone(),
            clustering: cluster(&reduced, *n_classes, config, seed, &go_on)?,
            choices: Vec::new(),
        };
        let objects: Vec<Arc<ObjectAppearance>> =
            splits.iter().map(|split| Arc::new(appearance(split, &vocabulary))).collect();
        let shares = ObjectShares::new(&objects, &vocabulary.clustering, config.smoothing);
        choices.push(count(&objects, &shares, *n_classes, config.report_readings, seed));
        if best_class_count(&choices) == Some(choices.len() - 1) {
            best = Some(vocabulary);
        }
    }
    let best = best.ok_or(AppearanceTrainError::NoCandidate)?;
    Ok(AppearanceVocabulary { choices, ..best })
}

/// The appearance of one object in a vocabulary, its own or that of a catalogue that it joins.
///
/// # Errors
/// [`AppearanceTrainError`] when the set does not fit the vocabulary.
pub fn object_histogram(
    set: &AppearanceSet<'_>,
    vocabulary: &AppearanceVocabulary,
    config: &AppearanceConfig,
) -> Result<ObjectAppearance, AppearanceTrainError> {
    check(config)?;
    let split = split(set, vocabulary.source, config.held_back_share)?;
    if split.training.is_empty() {
        return Err(AppearanceTrainError::NothingTouched);
    }
    Ok(appearance(&split, vocabulary))
}

/// Builds a model of objects and their vocabulary: calibrates the exponent and makes the report.
#[must_use]
pub fn appearance_model(
    vocabulary: Arc<AppearanceVocabulary>,
    objects: Vec<Arc<ObjectAppearance>>,
    config: &AppearanceConfig,
    seed: u64,
) -> AppearanceModel {
    let shares = ObjectShares::new(&objects, &vocabulary.clustering, config.smoothing);
    let exponent = fit_exponent(&objects, &shares, config.report_readings, seed);
    let report = report(&objects, &shares, exponent, config.report_readings, seed);
    AppearanceModel { vocabulary, objects, smoothing: config.smoothing, exponent, report }
}

fn check(config: &AppearanceConfig) -> Result<(), AppearanceTrainError> {
    let within = |field, found: f64, low, high| {
        let valid = (low..=high).contains(&found);
        valid.then_some(()).ok_or(AppearanceTrainError::Range { field, found, low, high })
    };
    within("variance_share", config.variance_share, 0.01, 1.0)?;
    within("smoothing", config.smoothing, 1e-6, 1e6)?;
    within("held_back_share", config.held_back_share, 0.0, 0.9)?;
    within("n_starts", config.n_starts as f64, 1.0, 100.0)?;
    within("report_readings", config.report_readings as f64, 1.0, 10_000.0)?;
    if let Some(discriminant) = &config.discriminant {
        within("n_axes", discriminant.n_axes as f64, 1.0, 10_000.0)?;
        within("shrinkage", discriminant.shrinkage, 0.0, 1.0)?;
    }
    if config.n_classes.is_empty() {
        return Err(AppearanceTrainError::NoCandidate);
    }
    for n_classes in &config.n_classes {
        within("n_classes", *n_classes as f64, 1.0, MAX_APPEARANCE_CLASSES as f64)?;
    }
    Ok(())
}

fn reduce(pca: &Pca, discriminant: Option<&Discriminant>, feature: &[f64]) -> Vec<f64> {
    let principal = pca.project_one(feature);
    discriminant.map_or_else(|| principal.clone(), |axes| axes.project(&principal))
}

/// Clusters the objects' reduced features into classes.
fn cluster(
    objects: &[Vec<Vec<f64>>],
    n_classes: usize,
    config: &AppearanceConfig,
    seed: u64,
    go_on: &(dyn Fn() -> bool + Sync),
) -> Result<Clustering, AppearanceTrainError> {
    let n_starts = config.n_starts;
    let mixture = |covariances| {
        let settings =
            MixtureConfig { n_starts, covariances, ..MixtureConfig::with_components(n_classes) };
        let fit = fit_mixture_while(&objects.concat(), &settings, seed, go_on);
        Ok(Clustering::Mixture(fit.ok_or(AppearanceTrainError::Stopped)?.mixture))
    };
    match config.clustering {
        ClusteringMethod::KMeans if !go_on() => Err(AppearanceTrainError::Stopped),
        ClusteringMethod::KMeans => {
            let settings = KMeansConfig { n_starts, ..KMeansConfig::with_classes(n_classes) };
            Ok(Clustering::KMeans(k_means(&objects.concat(), &settings, seed)))
        }
        ClusteringMethod::Mixture => mixture(Covariances::Full),
        ClusteringMethod::SharedMixture => mixture(Covariances::Shared),
        ClusteringMethod::PerObject => Ok(Clustering::Mixture(labelled_mixture(objects)?)),
    }
}

fn appearance(split: &Split, vocabulary: &AppearanceVocabulary) -> ObjectAppearance {
    let classes = |readings: &[FeatureMatrix]| -> Vec<ReadingClasses> {
        readings.par_iter().map(|reading| vocabulary.classify(reading)).collect()
    };
    let training = classes(&split.training);
    let shares: Vec<Vec<f64>> = training.iter().map(ReadingClasses::mean).collect();
    let log_joints: Vec<Vec<f64>> = split
        .training_features()
        .map(|feature| vocabulary.clustering.log_joint(&vocabulary.reduce(feature)))
        .collect();
    ObjectAppearance {
        histogram: ClassHistogram::of(vocabulary.n_classes(), &shares),
        joint: joint_shares(vocabulary.n_classes(), &log_joints),
        held_back: classes(&split.held_back),
    }
}
