//! Chapter 5's appearance as printed, for the rows `as_printed` of `sva-objects` and `letters-sva`.
//!
//! Features are compared by plain inner products, without the training mean taken off; the image
//! is masked before it is turned; every class above T_a is kept; a patch lies at the sensor's
//! centroid (sections 4.3.2.4 and 5.3.1-5.3.3). The floor of a class's spread is too low to
//! bind; the service's would, since plain products bring affinities close to 1.

use anyhow::Context as _;
use glam::DVec3;
use palpate_core::contact::touches;
use palpate_core::contact::{contact_points, normal_constraint};
use palpate_core::descriptor::mnti::Mnti;
use palpate_core::descriptor::moment_normalized::{MaskOrder, MomentNormalizer};
use palpate_core::descriptor::{Descriptor, DescriptorKind, affinity};
use palpate_core::reading::{Reading, TactileImage};
use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::SensorDescription;
use palpate_core::units::MM;
use palpate_core::vocabulary::association::{associate, spreads_above};
use palpate_core::vocabulary::medoids::choose_medoids;
use palpate_core::vocabulary::{AssociationRule, MAX_CLASSES, Vocabulary};
use palpate_dissertation::patch::Patch;
use palpate_dissertation::patch_pair::DistanceBins;
use palpate_dissertation::sva::model::{ObjectMap, SvaModel};
use rayon::prelude::*;

/// Maximum number of features among which medoids are chosen (the cost is quadratic).
const MEDOID_SAMPLE: usize = 2_000;

/// Minimum spread, which keeps that of a class of one feature positive.
const SPREAD_MIN: f64 = 1e-12;

/// T_a as printed, with no limit on the number of classes kept.
const RULE: AssociationRule = AssociationRule { threshold: 0.75, max_classes: MAX_CLASSES };

/// The settings of one of the dissertation's experiments.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrintedForm {
    /// The descriptor: MNTI, or else Moment-Normalised.
    pub descriptor: PrintedDescriptor,
    /// n_C, the number of appearance classes.
    pub n_classes: usize,
    /// The range of the distances between patches.
    pub distances: DistanceBins,
    /// Whether normals are known, as those of raised letters are, or have the confidence of
    /// algorithm 2.
    pub normals: Normals,
}

/// Descriptors of chapter 5's experiments.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PrintedDescriptor {
    /// MNTI, for objects (section 5.5.1).
    Mnti,
    /// Moment-Normalised, for letters (section 5.5.2).
    MomentNormalized,
}

/// Confidence of a patch's normal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Normals {
    /// Of algorithm 2.
    Estimated,
    /// "All known and equal" (section 5.6.1): 1.
    Known,
}

impl PrintedForm {
    /// Section 5.5.1: 25 classes of MNTI, 40 distances of 30 to 160 mm.
    ///
    /// # Panics
    /// Never: the range is one.
    #[must_use]
    pub fn objects() -> Self {
        let distances = DistanceBins::new(30.0 * MM, 160.0 * MM, 40).expect("a range");
        let (descriptor, normals) = (PrintedDescriptor::Mnti, Normals::Estimated);
        Self { descriptor, n_classes: 25, distances, normals }
    }

    /// Section 5.5.2: Moment-Normalised, 100 distances of 3 to 20 mm. The number of classes is
    /// not printed; 25 is that of section 5.5.1.
    ///
    /// # Panics
    /// Never: the range is one.
    #[must_use]
    pub fn letters() -> Self {
        let distances = DistanceBins::new(3.0 * MM, 20.0 * MM, 100).expect("a range");
        let (descriptor, normals) = (PrintedDescriptor::MomentNormalized, Normals::Known);
        Self { descriptor, n_classes: 25, distances, normals }
    }

    fn plan(&self, rows: usize, cols: usize) -> Box<dyn Descriptor> {
        let order = MaskOrder::MaskFirst;
        match self.descriptor {
            PrintedDescriptor::Mnti => Box::new(Mnti::with_mask(rows, cols, order)),
            PrintedDescriptor::MomentNormalized => {
                Box::new(MomentNormalizer::with_mask(rows, cols, order))
            }
        }
    }
}

/// Appearance classes as printed.
pub struct Printed {
    form: PrintedForm,
    descriptor: Box<dyn Descriptor>,
    medoids: Vec<Vec<f64>>,
    spreads: Vec<f64>,
}

impl Printed {
    /// Learns the classes from the readings of all objects.
    ///
    /// # Errors
    /// When no reading touched anything.
    pub fn learn(
        readings: &[Vec<Reading>],
        sensor: &SensorDescription,
        form: PrintedForm,
        seed: u64,
    ) -> anyhow::Result<Self> {
        let touching = readings.iter().flatten().filter(|reading| touches(reading, sensor));
        let images: Vec<&TactileImage> = touching.map(Reading::image).collect();
        let first = images.first().context("no training reading touched anything")?;
        let descriptor = form.plan(first.rows, first.cols);
        let described = descriptor.describe(&images);
        let features: Vec<Vec<f64>> = described.rows().map(<[f64]>::to_vec).collect();
        let step = features.len().div_ceil(MEDOID_SAMPLE);
        let candidates: Vec<Vec<f64>> = features.iter().step_by(step).cloned().collect();
        let mut stream = Stream::new(seed, Purpose::Clustering, 0);
        let medoids: Vec<Vec<f64>> = choose_medoids(&candidates, form.n_classes, &mut stream)
            .into_iter()
            .map(|index| candidates[index].clone())
            .collect();
        let membership: Vec<usize> = features.iter().map(|f| nearest(f, &medoids)).collect();
        let spreads = spreads_above(SPREAD_MIN, &features, &medoids, &membership);
        Ok(Self { form, descriptor, medoids, spreads })
    }

    /// The patch of a reading in the frame of its pose; `None` when it touched nothing.
    #[must_use]
    pub fn patch(&self, reading: &Reading, sensor: &SensorDescription) -> Option<Patch> {
        let image = reading.image();
        if !touches(reading, sensor) {
            return None;
        }
        let session_from_sensor = reading.session_from_sensor();
        let features = self.descriptor.describe(&[image]);
        let normal_confidence = match self.form.normals {
            Normals::Estimated => normal_constraint(&contact_points(image, sensor)),
            Normals::Known => 1.0,
        };
        Some(Patch {
            position: session_from_sensor.translation,
            normal: session_from_sensor.turn(DVec3::NEG_Z),
            normal_confidence,
            classes: associate(features.row(0), &self.medoids, &self.spreads, RULE),
        })
    }

    /// The maps of all objects over the printed distances, and the mean number of classes of a
    /// patch.
    ///
    /// # Errors
    /// When too few readings touched an object.
    pub fn catalogue(
        &self,
        readings: &[Vec<Reading>],
        sensor: &SensorDescription,
    ) -> anyhow::Result<(SvaModel, f64)> {
        let distances = self.form.distances;
        let patches_of = |readings: &Vec<Reading>| -> Vec<Patch> {
            readings.iter().filter_map(|reading| self.patch(reading, sensor)).collect()
        };
        let patches: Vec<Vec<Patch>> = readings.par_iter().map(patches_of).collect();
        let n_patches: usize = patches.iter().map(Vec::len).sum();
        let n_kept: usize = patches.iter().flatten().map(|patch| patch.classes.len()).sum();
        let map = |patches: &Vec<Patch>| {
            // The objects' frames are those of training.
            let map = ObjectMap::build(patches, DVec3::ZERO, self.medoids.len(), distances)?;
            Ok(map.into())
        };
        let objects = patches.par_iter().map(map).collect::<anyhow::Result<_>>()?;
        let (rows, cols) = self.descriptor.shape();
        let vocabulary = Vocabulary {
            descriptor: match self.form.descriptor {
                PrintedDescriptor::Mnti => DescriptorKind::Mnti,
                PrintedDescriptor::MomentNormalized => DescriptorKind::MomentNormalized,
            },
            rows,
            cols,
            mean: vec![0.0; self.descriptor.dimension()],
            medoids: self.medoids.clone(),
            spreads: self.spreads.clone(),
        };
        let catalogue = SvaModel { vocabulary, association: RULE, objects };
        Ok((catalogue, n_kept as f64 / n_patches.max(1) as f64))
    }
}

/// The class whose medoid is nearest to a feature.
fn nearest(feature: &[f64], medoids: &[Vec<f64>]) -> usize {
    let affinities: Vec<f64> = medoids.iter().map(|medoid| affinity(feature, medoid)).collect();
    (1..affinities.len()).fold(0, |a, b| if affinities[b] > affinities[a] { b } else { a })
}
