//! Recognition by appearance alone: belief over identity from readings without poses.
//!
//! Source: sections 4.3.1.2 and 4.4.2.1, equations 4.1–4.4, 4.17 and 4.18–4.22; deviations
//! are in `docs/equations.md`. The evidence of each reading is independent of the others and
//! of the object's pose, so an object may move between touches. The evidence is kept sorted
//! and summed in that order: no order of readings changes a bit.

pub mod model;
pub mod train;

use std::sync::Arc;

use thiserror::Error;

use crate::appearance::model::{AppearanceModel, AppearanceRule, AppearanceSource, ObjectShares};
use palpate_core::belief::answer::Answer;
use palpate_core::belief::{MismatchError, log_prior};
use palpate_core::contact::touches;
use palpate_core::descriptor::FeatureMatrix;
use palpate_core::log_prob::{entropy_bits, normalize};
use palpate_core::reading::Reading;
use palpate_core::sensor::SensorDescription;
use palpate_core::vocabulary::bag::{joint_shares, log_likelihood};

/// Exponent of the likelihood.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Exponent {
    /// The model's, fitted on held-out readings: touches are correlated.
    Calibrated,
    /// A fixed exponent; 1 as printed.
    Fixed(f64),
}

/// Comparison of readings with objects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AppearanceOptions {
    /// Rule for comparing histograms.
    pub rule: AppearanceRule,
    /// Exponent of the likelihood.
    pub exponent: Exponent,
}

impl Default for AppearanceOptions {
    /// The service's defaults.
    fn default() -> Self {
        Self { rule: AppearanceRule::Divergence, exponent: Exponent::Calibrated }
    }
}

impl AppearanceOptions {
    /// The rule of least divergence as printed (equations 4.4 and 4.22), on responsibilities.
    #[must_use]
    pub fn literal() -> Self {
        Self { rule: AppearanceRule::Divergence, exponent: Exponent::Fixed(1.0) }
    }

    /// Like `literal`, on summed joint densities, as equation 4.17 is printed.
    #[must_use]
    pub fn literal_joint() -> Self {
        Self { rule: AppearanceRule::LiteralJoint, exponent: Exponent::Fixed(1.0) }
    }
}

/// Error of a reading that cannot be used with an appearance model.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum AppearanceError {
    /// The reading's image or the prior does not fit the catalogue.
    #[error(transparent)]
    Recognise(#[from] MismatchError),
    /// The model was trained on clients' features, and the reading has an image.
    #[error("reading without a feature, expected {dimension} values as the model was trained with")]
    FeatureExpected {
        /// Length of the model's features.
        dimension: usize,
    },
    /// The model was trained on images, and the reading has a feature.
    #[error("reading with a feature, expected an image of {rows}×{cols} taxels alone")]
    ImageExpected {
        /// Rows of the model's images.
        rows: usize,
        /// Columns of the model's images.
        cols: usize,
    },
    /// A feature of the wrong length.
    #[error("feature of {found} values, expected {expected} finite numbers")]
    Feature {
        /// Length of the model's features.
        expected: usize,
        /// Length of the given feature.
        found: usize,
    },
}

/// A belief over the identity of one object, from the readings so far.
#[derive(Clone, Debug)]
pub struct AppearanceBelief {
    model: Arc<AppearanceModel>,
    shares: ObjectShares,
    options: AppearanceOptions,
    log_prior: Vec<f64>,
    /// Ascending. One row per reading, its ln likelihood by object; for the literal joint
    /// rule one row per feature, its ln joint density by class.
    evidence: Vec<Vec<f64>>,
    n_readings: usize,
}

impl AppearanceBelief {
    /// Bytes of memory of this belief, without the shared model.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let numbers: usize = self.evidence.iter().map(Vec::capacity).sum();
        size_of::<Self>() + (numbers + self.log_prior.capacity()) * size_of::<f64>()
    }

    /// The belief before any reading. `prior` weighs the objects (it is normalised); `None` is
    /// uniform.
    ///
    /// # Errors
    /// [`AppearanceError::Recognise`] when the prior does not fit the catalogue.
    pub fn new(
        model: Arc<AppearanceModel>,
        options: AppearanceOptions,
        prior: Option<&[f64]>,
    ) -> Result<Self, AppearanceError> {
        let log_prior = log_prior(prior, model.objects.len())?;
        let shares = match options.rule {
            AppearanceRule::Mixture | AppearanceRule::Divergence => {
                ObjectShares::new(&model.objects, &model.vocabulary.clustering, model.smoothing)
            }
            AppearanceRule::LiteralJoint => ObjectShares::joint(&model.objects, model.smoothing),
        };
        Ok(Self { model, shares, options, log_prior, evidence: Vec::new(), n_readings: 0 })
    }

    /// Adds a reading. A press without contact counts as a reading and adds no evidence.
    ///
    /// # Errors
    /// [`AppearanceError`] when the image does not fit the model.
    pub fn add(
        &mut self,
        reading: &Reading,
        sensor: &SensorDescription,
    ) -> Result<(), AppearanceError> {
        let image = reading.image();
        let (rows, cols) = match self.model.vocabulary.source {
            AppearanceSource::Image { rows, cols, .. } => (rows, cols),
            AppearanceSource::External { dimension } => {
                return Err(AppearanceError::FeatureExpected { dimension });
            }
        };
        let Some(features) = self.model.vocabulary.describe(image) else {
            let (found_rows, found_cols) = (image.rows, image.cols);
            return Err(MismatchError::Shape { rows, cols, found_rows, found_cols }.into());
        };
        self.n_readings += 1;
        if touches(reading, sensor) {
            self.take(&features);
        }
        Ok(())
    }

    /// Adds a reading with the client's own feature instead of an image.
    ///
    /// # Errors
    /// [`AppearanceError`] when the model was not trained with such features.
    pub fn add_feature(&mut self, feature: &[f64]) -> Result<(), AppearanceError> {
        let expected = match self.model.vocabulary.source {
            AppearanceSource::External { dimension } => dimension,
            AppearanceSource::Image { rows, cols, .. } => {
                return Err(AppearanceError::ImageExpected { rows, cols });
            }
        };
        if feature.len() != expected || !feature.iter().all(|value| value.is_finite()) {
            return Err(AppearanceError::Feature { expected, found: feature.len() });
        }
        self.n_readings += 1;
        self.take(&FeatureMatrix::from_parts(expected, feature.to_vec(), vec![0]));
        Ok(())
    }

    fn take(&mut self, features: &FeatureMatrix) {
        let vocabulary = self.model.vocabulary.clone();
        match self.options.rule {
            AppearanceRule::Mixture | AppearanceRule::Divergence => {
                let classes = vocabulary.classify(features);
                self.insert(self.shares.log_likelihoods(&classes, self.options.rule));
            }
            AppearanceRule::LiteralJoint => {
                for feature in features.rows() {
                    self.insert(vocabulary.clustering.log_joint(&vocabulary.reduce(feature)));
                }
            }
        }
    }

    /// Keeps the evidence ascending; equal rows are interchangeable.
    fn insert(&mut self, evidence: Vec<f64>) {
        let order = |row: &Vec<f64>| {
            let firsts = row.iter().zip(&evidence).map(|(a, b)| a.total_cmp(b));
            firsts.fold(std::cmp::Ordering::Equal, std::cmp::Ordering::then)
        };
        let place = self.evidence.partition_point(|row| order(row).is_lt());
        self.evidence.insert(place, evidence);
    }

    /// The belief as an answer, without poses.
    #[must_use]
    pub fn answer(&self) -> Answer {
        let exponent = match self.options.exponent {
            Exponent::Calibrated => self.model.exponent,
            Exponent::Fixed(exponent) => exponent,
        };
        let logs: Vec<f64> = self
            .log_likelihoods()
            .iter()
            .zip(&self.log_prior)
            .map(|(log, prior)| exponent * log + prior)
            .collect();
        let probabilities = normalize(&logs);
        let entropy_bits = entropy_bits(&probabilities);
        Answer {
            probabilities,
            unknown: 0.0,
            modes: Vec::new(),
            entropy_bits,
            n_readings: self.n_readings,
            sensor_shift: None,
            image_doubt: None,
        }
    }

    /// ln likelihood of all readings by object, before prior and exponent.
    fn log_likelihoods(&self) -> Vec<f64> {
        let n_objects = self.shares.known.len();
        if self.evidence.is_empty() {
            return vec![0.0; n_objects];
        }
        match self.options.rule {
            AppearanceRule::Mixture | AppearanceRule::Divergence => {
                let mut sum = vec![0.0; n_objects];
                for row in &self.evidence {
                    sum.iter_mut().zip(row).for_each(|(sum, log)| *sum += log);
                }
                sum
            }
            AppearanceRule::LiteralJoint => {
                let observed = joint_shares(self.model.vocabulary.n_classes(), &self.evidence);
                let n = self.evidence.len() as f64;
                self.shares.known.iter().map(|k| n * log_likelihood(&observed, k)).collect()
            }
        }
    }

    /// Number of readings.
    #[must_use]
    pub fn n_readings(&self) -> usize {
        self.n_readings
    }
}
