//! Chapter 5's appearance as printed, for `sva-objects --as-printed`.
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
use palpate_core::descriptor::moment_normalized::MaskOrder;
use palpate_core::descriptor::{Descriptor as _, DescriptorKind, affinity};
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

/// Appearance classes as printed.
pub(super) struct Printed {
    descriptor: Mnti,
    medoids: Vec<Vec<f64>>,
    spreads: Vec<f64>,
}

impl Printed {
    /// Learns `n_classes` classes from the readings of all objects.
    pub(super) fn learn(
        readings: &[Vec<Reading>],
        sensor: &SensorDescription,
        n_classes: usize,
        seed: u64,
    ) -> anyhow::Result<Self> {
        let touching = readings.iter().flatten().filter(|reading| touches(reading, sensor));
        let images: Vec<&TactileImage> = touching.map(Reading::image).collect();
        let first = images.first().context("no training reading touched anything")?;
        let descriptor = Mnti::with_mask(first.rows, first.cols, MaskOrder::MaskFirst);
        let described = descriptor.describe(&images);
        let features: Vec<Vec<f64>> = described.rows().map(<[f64]>::to_vec).collect();
        let step = features.len().div_ceil(MEDOID_SAMPLE);
        let candidates: Vec<Vec<f64>> = features.iter().step_by(step).cloned().collect();
        let mut stream = Stream::new(seed, Purpose::Clustering, 0);
        let medoids: Vec<Vec<f64>> = choose_medoids(&candidates, n_classes, &mut stream)
            .into_iter()
            .map(|index| candidates[index].clone())
            .collect();
        let membership: Vec<usize> = features.iter().map(|f| nearest(f, &medoids)).collect();
        let spreads = spreads_above(SPREAD_MIN, &features, &medoids, &membership);
        Ok(Self { descriptor, medoids, spreads })
    }

    /// The patch of a reading in the frame of its pose; `None` when it touched nothing.
    pub(super) fn patch(&self, reading: &Reading, sensor: &SensorDescription) -> Option<Patch> {
        let image = reading.image();
        if !touches(reading, sensor) {
            return None;
        }
        let session_from_sensor = reading.session_from_sensor();
        let features = self.descriptor.describe(&[image]);
        Some(Patch {
            position: session_from_sensor.translation,
            normal: session_from_sensor.turn(DVec3::NEG_Z),
            normal_confidence: normal_constraint(&contact_points(image, sensor)),
            classes: associate(features.row(0), &self.medoids, &self.spreads, RULE),
        })
    }

    /// The maps of all objects over the printed distances of 30-160 mm, and the mean number of
    /// classes of a patch.
    pub(super) fn catalogue(
        &self,
        readings: &[Vec<Reading>],
        sensor: &SensorDescription,
    ) -> anyhow::Result<(SvaModel, f64)> {
        let distances = DistanceBins::new(30.0 * MM, 160.0 * MM, 40)?;
        let patches_of = |readings: &Vec<Reading>| -> Vec<Patch> {
            readings.iter().filter_map(|reading| self.patch(reading, sensor)).collect()
        };
        let patches: Vec<Vec<Patch>> = readings.par_iter().map(patches_of).collect();
        let n_patches: usize = patches.iter().map(Vec::len).sum();
        let n_kept: usize = patches.iter().flatten().map(|patch| patch.classes.len()).sum();
        let map = |patches: &Vec<Patch>| {
            // The meshes' centroids are their origins already.
            let map = ObjectMap::build(patches, DVec3::ZERO, self.medoids.len(), distances)?;
            Ok(map.into())
        };
        let objects = patches.par_iter().map(map).collect::<anyhow::Result<_>>()?;
        let (rows, cols) = self.descriptor.shape();
        let vocabulary = Vocabulary {
            descriptor: DescriptorKind::Mnti,
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
