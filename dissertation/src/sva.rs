//! Recognition by spatially varying appearance: belief over identity and pose.
//!
//! Source: sections 5.2–5.4. Each new reading is paired with earlier ones; the objects'
//! indexes return the stored pairs that match, each match gives a set of poses, and the
//! sparse histograms multiply the pairs' distributions. Objects are processed in parallel;
//! the answer does not depend on the number of threads.

pub mod model;
pub mod refine;
mod priors;
mod options;
mod matching;
#[cfg(test)]
mod test_support;
pub mod train;

use std::sync::Arc;

use crate::filter::sparse::{PairEvidence, SparseHistogram};
use crate::patch::{Patch, observe_patch};
use crate::rotation_grid::RotationGrid;
use crate::sva::model::{ObjectMap, SvaModel};
use crate::sva::refine::refine;
use matching::{PairQuery, find_poses};
pub use options::{BinPose, PairWeight, SvaOptions};
use palpate_core::belief::answer::{Answer, ModeScale, WeightedPose, answer};
use palpate_core::belief::{MismatchError, log_prior};
use palpate_core::object::ObjectIdx;
use palpate_core::reading::Reading;
use palpate_core::sensor::SensorDescription;
use palpate_core::stop::Stop;
use palpate_core::vocabulary::Association;
pub use priors::MatchPriors;
use priors::MatchWeights;
use rayon::prelude::*;

/// A belief over the identity and pose of one object, from the readings so far.
#[derive(Clone, Debug)]
pub struct SvaBelief {
    catalogue: Arc<SvaModel>,
    options: SvaOptions,
    weights: Arc<MatchWeights>,
    log_prior: Vec<f64>,
    seen: Vec<Patch>,
    histograms: Vec<SparseHistogram>,
    n_readings: usize,
    stop: Stop,
}

impl SvaBelief {
    /// Bytes of memory of this belief, without the shared catalogue.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let seen = |patch: &Patch| {
            size_of::<Patch>() + patch.classes.capacity() * size_of::<Association>()
        };
        size_of::<Self>()
            + self.weights.bytes()
            + self.log_prior.capacity() * size_of::<f64>()
            + self.seen.iter().map(seen).sum::<usize>()
            + self.histograms.iter().map(SparseHistogram::bytes).sum::<usize>()
    }

    /// The belief before any reading. `prior` weighs the objects (it is normalised); `None`
    /// is uniform.
    ///
    /// # Errors
    /// [`MismatchError::Prior`] when the weights do not fit the catalogue.
    pub fn new(
        catalogue: Arc<SvaModel>,
        options: SvaOptions,
        prior: Option<&[f64]>,
    ) -> Result<Self, MismatchError> {
        let n_objects = catalogue.objects.len();
        let log_prior = log_prior(prior, n_objects)?;
        let histograms = vec![SparseHistogram::new(options.rule, options.bins_max); n_objects];
        let weights = Arc::new(MatchWeights::new(&catalogue.objects, options.priors));
        let (seen, stop) = (Vec::new(), Stop::never());
        Ok(Self { catalogue, options, weights, log_prior, seen, histograms, n_readings: 0, stop })
    }

    /// Makes long loops unwind once `stop` is requested ([`Stop::check`]).
    pub fn heed(&mut self, stop: &Stop) {
        self.stop = stop.clone();
    }

    /// Adds a reading. A press without contact counts as a reading and adds no evidence.
    ///
    /// # Errors
    /// [`MismatchError::Shape`] when the image does not fit the catalogue's vocabulary.
    pub fn add(
        &mut self,
        reading: &Reading,
        sensor: &SensorDescription,
    ) -> Result<(), MismatchError> {
        let vocabulary = &self.catalogue.vocabulary;
        if !vocabulary.fits(reading.image()) {
            return Err(MismatchError::Shape {
                rows: vocabulary.rows,
                cols: vocabulary.cols,
                found_rows: reading.image().rows,
                found_cols: reading.image().cols,
            });
        }
        let rule = self.catalogue.association;
        match observe_patch(reading, sensor, vocabulary, rule) {
            Some(patch) => self.add_patch(patch),
            None => self.n_readings += 1,
        }
        Ok(())
    }

    /// Adds a reading by its patch: in the session frame, with classes of the catalogue.
    pub fn add_patch(&mut self, patch: Patch) {
        self.n_readings += 1;
        for partner in partners(self.seen.len(), self.options.partners_max) {
            let earlier = self.seen[partner].clone();
            self.multiply_pair(&patch, &earlier);
        }
        self.histograms.par_iter_mut().for_each(SparseHistogram::prune);
        self.seen.push(patch);
    }

    /// Equation 5.12: multiplies in the distribution of one pair of readings.
    fn multiply_pair(&mut self, a: &Patch, b: &Patch) {
        let Some(query) = PairQuery::new(a, b) else {
            return;
        };
        let evidence: Vec<PairEvidence> = self
            .catalogue
            .objects
            .par_iter()
            .map(|object| {
                self.stop.check();
                find_poses(object, &query, &self.options, &self.weights)
            })
            .collect();
        // Equation 5.14, normalised per object: more training pairs are no evidence.
        let per_pair: Vec<f64> =
            self.catalogue.objects.iter().map(|o| per_training_pair(o)).collect();
        let total: f64 = evidence.iter().zip(&per_pair).map(|(e, share)| e.total() * share).sum();
        if total <= 0.0 {
            return;
        }
        let exponent = match self.options.pair_weight {
            PairWeight::BothOrders => 2.0,
            PairWeight::Once => 1.0,
        };
        let log_count = self.options.bins.log_count();
        let even = -(self.catalogue.objects.len() as f64).ln();
        let multiply_all = |histograms: &mut Vec<SparseHistogram>| {
            let zipped = histograms.par_iter_mut().zip(&evidence).zip(&per_pair);
            zipped.for_each(|((histogram, evidence), share)| {
                histogram.multiply(evidence, share / total, even - log_count, exponent);
            });
        };
        multiply_all(&mut self.histograms);
        // Section 5.6.1: when all probabilities have gone to zero the belief is re-seeded.
        if self.histograms.iter().all(SparseHistogram::is_impossible) {
            self.histograms.iter_mut().for_each(SparseHistogram::reset);
            multiply_all(&mut self.histograms);
        }
    }

    /// The belief as an answer with at most `n_modes` poses.
    #[must_use]
    pub fn answer(&self, n_modes: usize) -> Answer {
        let log_count = self.options.bins.log_count();
        let log_objects: Vec<f64> = self
            .histograms
            .iter()
            .zip(&self.log_prior)
            .map(|(histogram, prior)| histogram.log_evidence(log_count) + prior)
            .collect();
        let mut poses = Vec::new();
        for (object, (histogram, prior)) in self.histograms.iter().zip(&self.log_prior).enumerate()
        {
            let best = histogram.best(BINS_FOR_MODES, log_count);
            poses.extend(best.into_iter().map(|(log, bin, mean)| WeightedPose {
                object: ObjectIdx(object as u32),
                session_from_object: match self.options.bin_pose {
                    BinPose::Center => self.options.bins.center(bin),
                    BinPose::Mean => mean,
                },
                log_weight: log + prior,
            }));
        }
        let edge = self.options.bins.edge;
        let width = rotation_width(self.options.bins.rotations);
        // As printed, the answer is the best bin alone; otherwise neighbours share a mode.
        let reach = match self.options.bin_pose {
            BinPose::Center => 0.0,
            BinPose::Mean => 1.0,
        };
        let scale = ModeScale {
            distance: 1.5 * edge * reach,
            angle: 1.2 * width * reach,
            position_deviation: edge / 12.0_f64.sqrt(),
            rotation_deviation: width / 12.0_f64.sqrt(),
        };
        let mut answer = answer(&log_objects, poses, n_modes, &scale, self.n_readings);
        if let Some(settings) = &self.options.refinement {
            answer.modes.par_iter_mut().for_each(|mode| {
                let map = self.catalogue.objects[mode.object.0 as usize].patches();
                if let Some(better) = refine(mode.session_from_object, &self.seen, map, settings) {
                    mode.session_from_object = better.session_from_object;
                    mode.covariance = better.covariance;
                }
            });
        }
        answer
    }

    /// Number of readings.
    #[must_use]
    pub fn n_readings(&self) -> usize {
        self.n_readings
    }
}

/// Number of an object's bins from which modes are formed.
const BINS_FOR_MODES: usize = 64;

/// The edge of a rotation bin, as an angle of rotation.
fn rotation_width(grid: RotationGrid) -> f64 {
    match grid {
        RotationGrid::Rodrigues { n } => std::f64::consts::TAU / f64::from(n),
        RotationGrid::CubedHypersphere { n } => std::f64::consts::PI / f64::from(n),
    }
}

fn per_training_pair(object: &ObjectMap) -> f64 {
    let n = object.patches().len() as f64;
    2.0 / (n * (n - 1.0))
}

/// The earlier readings, out of `n`, with which a new one is paired: all, or `max` spread evenly.
fn partners(n: usize, max: usize) -> Vec<usize> {
    if n <= max { (0..n).collect() } else { (0..max).map(|k| k * n / max).collect() }
}

#[cfg(test)]
mod tests;
