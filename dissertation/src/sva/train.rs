//! Training of spatially varying appearance: a vocabulary and maps from readings of known objects.
//!
//! Source: section 5.5.1.1 and `docs/equations.md`. The vocabulary is learnt once from all
//! objects; each object's map depends on its own readings and the vocabulary alone, so an
//! object can be added to a catalogue without changing the others. Frames: a training
//! reading's pose is `object_from_sensor` in the frame of the mesh or of the robot that took
//! it. Not here: the source of readings, and storage.

use glam::DVec3;
use thiserror::Error;

use crate::patch::{Patch, observe_patch};
use crate::patch_pair::DistanceBins;
use crate::sva::model::ObjectMap;
use palpate_core::contact::touches;
use palpate_core::descriptor::DescriptorKind;
use palpate_core::object::MapError;
use palpate_core::reading::{Reading, TactileImage};
use palpate_core::rng::{Purpose, Stream};
use palpate_core::training::{TrainingError, TrainingSet, check_shapes, subsample};
use palpate_core::units::MM;
use palpate_core::vocabulary::association::spreads;
use palpate_core::vocabulary::medoids::choose_medoids;
use palpate_core::vocabulary::{AssociationRule, MAX_CLASSES, Vocabulary, center};

/// Maximum number of features among which medoids are chosen (the cost is quadratic).
const MEDOID_SAMPLE: usize = 2_000;

/// Configuration of training.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrainingConfig {
    /// Descriptor of the images.
    pub descriptor: DescriptorKind,
    /// n_C, the number of appearance classes.
    pub n_classes: usize,
    /// Association of features with classes.
    pub association: AssociationRule,
    /// Range of the distances between patches in the index.
    pub distances: DistanceRange,
}

/// Range of patch distances in an index.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DistanceRange {
    /// From `min` (m) to the largest trained distance, in `n` bins per map.
    ToLargest {
        /// The shortest indexed distance, metres.
        min: f64,
        /// Number of bins.
        n: u16,
    },
    /// Equal fixed bins for every object.
    Fixed(DistanceBins),
}

impl Default for TrainingConfig {
    /// The settings of `docs/equations.md`: 25 classes, T_a 0.75, 8 mm to the largest trained
    /// distance.
    fn default() -> Self {
        Self {
            descriptor: DescriptorKind::Mnti,
            n_classes: 25,
            association: AssociationRule::default(),
            distances: DistanceRange::ToLargest { min: 8.0 * MM, n: 40 },
        }
    }
}

impl TrainingConfig {
    /// The dissertation's settings: 40 bins over 30–160 mm for objects of 80 mm.
    #[must_use]
    pub fn literal() -> Self {
        let fixed = DistanceBins::new(30.0 * MM, 160.0 * MM, 40);
        let distances = fixed.map_or(Self::default().distances, DistanceRange::Fixed);
        Self { distances, ..Self::default() }
    }
}

/// Error of readings from which vocabularies and maps cannot be trained.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum SvaTrainError {
    /// The number of classes is out of range.
    #[error("{found} appearance classes, expected 1 to {MAX_CLASSES}")]
    Classes {
        /// The requested number.
        found: usize,
    },
    /// The descriptor gives several features per reading, but each touch needs one appearance.
    #[error("descriptor {descriptor} gives several features a reading, expected one of the others")]
    SeveralFeatures {
        /// The descriptor's name.
        descriptor: &'static str,
    },
    /// The readings cannot be used for training.
    #[error(transparent)]
    Readings(#[from] TrainingError),
}

/// Learns the appearance classes from the readings of all objects together.
///
/// At most 2,000 features, drawn with `seed`, are candidates for medoids; spreads (equation
/// 5.15) are of all features.
///
/// # Errors
/// [`SvaTrainError`] when nothing was touched, images differ in shape, the number of classes is
/// not 1 to 255, or the descriptor gives several features per reading.
pub fn learn_vocabulary(
    sets: &[TrainingSet<'_>],
    config: &TrainingConfig,
    seed: u64,
) -> Result<Vocabulary, SvaTrainError> {
    if !(1..=MAX_CLASSES).contains(&config.n_classes) {
        return Err(SvaTrainError::Classes { found: config.n_classes });
    }
    if !config.descriptor.gives_one_feature() {
        return Err(SvaTrainError::SeveralFeatures { descriptor: config.descriptor.name() });
    }
    let readings: Vec<&Reading> = sets
        .iter()
        .flat_map(|set| set.readings.iter().filter(|reading| touches(reading, set.sensor)))
        .collect();
    let Some(first) = readings.first() else {
        return Err(TrainingError::NothingTouched.into());
    };
    let (rows, cols) = (first.image().rows, first.image().cols);
    check_shapes(&readings, rows, cols)?;

    let images: Vec<&TactileImage> = readings.iter().map(|reading| reading.image()).collect();
    let described = config.descriptor.plan(rows, cols).describe(&images);
    let mean = described.mean();
    let features: Vec<Vec<f64>> =
        described.rows().map(|descriptor| center(descriptor.to_vec(), &mean)).collect();
    let mut stream = Stream::new(seed, Purpose::Clustering, 0);
    let candidates = subsample(&features, MEDOID_SAMPLE, &mut stream);
    let medoids: Vec<Vec<f64>> = choose_medoids(&candidates, config.n_classes, &mut stream)
        .into_iter()
        .map(|index| candidates[index].clone())
        .collect();
    let mut vocabulary = Vocabulary {
        descriptor: config.descriptor,
        rows,
        cols,
        mean,
        medoids,
        spreads: Vec::new(),
    };
    let membership: Vec<usize> =
        features.iter().map(|feature| usize::from(vocabulary.nearest(feature).0)).collect();
    vocabulary.spreads = spreads(&features, &vocabulary.medoids, &membership);
    Ok(vocabulary)
}

/// Maps one object. `origin_in_training` (metres) becomes the object frame's origin: its
/// mesh's centroid, or `None` for the centroid of the touches.
///
/// # Errors
/// [`SvaTrainError`] when images do not fit the vocabulary or too few readings touched.
pub fn map_object(
    set: &TrainingSet<'_>,
    vocabulary: &Vocabulary,
    config: &TrainingConfig,
    origin_in_training: Option<DVec3>,
) -> Result<ObjectMap, SvaTrainError> {
    let readings: Vec<&Reading> = set.readings.iter().collect();
    check_shapes(&readings, vocabulary.rows, vocabulary.cols)?;
    let patches: Vec<Patch> = readings
        .iter()
        .filter_map(|reading| observe_patch(reading, set.sensor, vocabulary, config.association))
        .collect();
    let centroid =
        || patches.iter().map(|p| p.position).sum::<DVec3>() / patches.len().max(1) as f64;
    let origin = origin_in_training.unwrap_or_else(centroid);
    let distances = distance_bins(&patches, config.distances).map_err(TrainingError::Map)?;
    Ok(ObjectMap::build(&patches, origin, vocabulary.n_classes(), distances)
        .map_err(TrainingError::Map)?)
}

fn distance_bins(patches: &[Patch], range: DistanceRange) -> Result<DistanceBins, MapError> {
    match range {
        DistanceRange::Fixed(bins) => Ok(bins),
        DistanceRange::ToLargest { min, n } => {
            let largest = patches
                .iter()
                .flat_map(|a| patches.iter().map(|b| a.position.distance_squared(b.position)))
                .fold(0.0, f64::max)
                .sqrt();
            // One step more, so that the largest distance itself lies inside the last bin.
            DistanceBins::new(min, largest.next_up().max(2.0 * min), n)
                .map_err(|_| MapError::TooFew { found: patches.len(), expected: 2 })
        }
    }
}
