//! The appearance model of chapter 4: histograms of objects' touches over appearance classes.
//!
//! One part of a catalogue, trained on request. The vocabulary is shared; an object's part
//! depends on its own readings and the vocabulary alone. Poses are not used. Not here:
//! training (`train`), beliefs (`appearance`).

use std::sync::Arc;

use palpate_core::descriptor::{DescriptorKind, FeatureMatrix};
use palpate_core::reading::TactileImage;
use palpate_core::vocabulary::bag::{
    ClassHistogram, Clustering, log_likelihood, log_mixture_ratio, reading_shares,
};
use palpate_core::vocabulary::choice::ClassCount;
use palpate_core::vocabulary::discriminant::Discriminant;
use palpate_core::vocabulary::pca::Pca;

use palpate_core::object::ObjectIdx;

/// Source of the features.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AppearanceSource {
    /// The image of a reading.
    Image {
        /// Descriptor of the images.
        descriptor: DescriptorKind,
        /// Rows of the images.
        rows: usize,
        /// Columns of the images.
        cols: usize,
    },
    /// A vector that clients send with a reading: their own feature.
    External {
        /// Its length.
        dimension: usize,
    },
}

/// Classes of appearance, from features to shares.
#[derive(Clone, Debug, PartialEq)]
pub struct AppearanceVocabulary {
    /// Source of the features.
    pub source: AppearanceSource,
    /// The first reduction: principal components.
    pub pca: Pca,
    /// The second reduction, if requested: axes that separate the training objects.
    pub discriminant: Option<Discriminant>,
    /// The classes, in the reduced space.
    pub clustering: Clustering,
    /// Result of each candidate for the number of classes on held-out readings.
    pub choices: Vec<ClassCount>,
}

/// Membership of a reading in the classes, feature by feature.
#[derive(Clone, Debug, PartialEq)]
pub struct ReadingClasses {
    /// Shares of each feature in the classes; they sum to 1.
    pub shares: Vec<Vec<f64>>,
}

impl ReadingClasses {
    /// The shares of the reading: the mean over its features.
    #[must_use]
    pub fn mean(&self) -> Vec<f64> {
        reading_shares(&self.shares)
    }
}

impl AppearanceVocabulary {
    /// The number of classes.
    #[must_use]
    pub fn n_classes(&self) -> usize {
        self.clustering.n_classes()
    }

    /// The features of an image, before any reduction; `None` when it has another shape or
    /// the features are the clients'.
    #[must_use]
    pub fn describe(&self, image: &TactileImage) -> Option<FeatureMatrix> {
        match self.source {
            AppearanceSource::Image { descriptor, rows, cols } => {
                ((image.rows, image.cols) == (rows, cols)).then(|| descriptor.describe(image))
            }
            AppearanceSource::External { .. } => None,
        }
    }

    /// A feature in the space of the classes.
    #[must_use]
    pub fn reduce(&self, feature: &[f64]) -> Vec<f64> {
        let principal = self.pca.project_one(feature);
        match &self.discriminant {
            Some(discriminant) => discriminant.project(&principal),
            None => principal,
        }
    }

    /// The classes of a reading, given by its features before reduction.
    #[must_use]
    pub fn classify(&self, features: &FeatureMatrix) -> ReadingClasses {
        let shares = |feature| self.clustering.shares(&self.reduce(feature));
        ReadingClasses { shares: features.rows().map(shares).collect() }
    }

    /// Whether the parts fit each other; checked when a model is loaded.
    #[must_use]
    pub fn is_consistent(&self) -> bool {
        let reduced = self
            .discriminant
            .as_ref()
            .map_or(self.pca.n_components(), |discriminant| discriminant.axes.len());
        let chained = self.discriminant.as_ref().is_none_or(|discriminant| {
            let n = self.pca.n_components();
            discriminant.mean.len() == n && discriminant.axes.iter().all(|axis| axis.len() == n)
        });
        chained && reduced > 0 && reduced == self.clustering.dimension()
    }
}

/// Appearance of one object.
#[derive(Clone, Debug, PartialEq)]
pub struct ObjectAppearance {
    /// The mass of its training readings in each class.
    pub histogram: ClassHistogram,
    /// Equation 4.17 as printed for the same readings: summed joint densities.
    pub joint: Vec<f64>,
    /// Held-out readings, which calibrate and report; the histogram excludes them.
    pub held_back: Vec<ReadingClasses>,
}

/// Rule for comparing histograms.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AppearanceRule {
    /// Each object is a mixture of the vocabulary's Gaussians with its own weights; with hard
    /// classes equal to [`AppearanceRule::Divergence`].
    Mixture,
    /// The rule of least divergence (equations 4.1–4.4, 4.18–4.22), on responsibilities.
    Divergence,
    /// Least divergence on histograms of summed joint densities, as equation 4.17 is printed.
    LiteralJoint,
}

/// The histograms of all objects, prepared for comparison with readings.
#[derive(Clone, Debug, PartialEq)]
pub struct ObjectShares {
    /// Pr(c_i|O_j), smoothed: one row an object.
    pub known: Vec<Vec<f64>>,
    /// Pr(c_i), the priors in the shares.
    pub priors: Vec<f64>,
}

impl ObjectShares {
    /// The smoothed histograms of objects.
    #[must_use]
    pub fn new(objects: &[Arc<ObjectAppearance>], clustering: &Clustering, smoothing: f64) -> Self {
        let known = objects.iter().map(|o| o.histogram.probabilities(smoothing)).collect();
        Self { known, priors: clustering.priors() }
    }

    /// The histograms from equation 4.17 as printed, with the same smoothing.
    #[must_use]
    pub fn joint(objects: &[Arc<ObjectAppearance>], smoothing: f64) -> Self {
        let smooth = |object: &Arc<ObjectAppearance>| {
            let n = object.histogram.total();
            let mass = object.joint.iter().map(|share| n * share).collect();
            ClassHistogram { mass }.probabilities(smoothing)
        };
        let known = objects.iter().map(smooth).collect();
        let n_classes = objects.first().map_or(0, |object| object.joint.len());
        Self { known, priors: vec![1.0; n_classes] }
    }

    /// ln Pr(reading|object) up to a constant, for each object; features of one reading share
    /// its mass of 1.
    #[must_use]
    pub fn log_likelihoods(&self, reading: &ReadingClasses, rule: AppearanceRule) -> Vec<f64> {
        let n = reading.shares.len().max(1) as f64;
        let one = |shares: &Vec<f64>, known: &Vec<f64>| match rule {
            AppearanceRule::Mixture => log_mixture_ratio(shares, known, &self.priors),
            AppearanceRule::Divergence | AppearanceRule::LiteralJoint => {
                log_likelihood(shares, known)
            }
        };
        let of_object = |known| reading.shares.iter().map(|s| one(s, known)).sum::<f64>() / n;
        self.known.iter().map(of_object).collect()
    }
}

/// Two objects of nearly equal appearance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearDuplicate {
    /// The earlier object.
    pub first: ObjectIdx,
    /// The later object.
    pub second: ObjectIdx,
    /// The correlation of their histograms, 0 to 1.
    pub affinity: f64,
}

/// Results on held-out readings (figures 4.9 and 4.10).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AppearanceReport {
    /// Number of readings in a trial.
    pub n_readings: usize,
    /// Mean probability of each object (column) when the row's object is touched; a row
    /// without held-out readings is all zeros.
    pub confusion: Vec<Vec<f64>>,
    /// Correlation of the objects' histograms, independent of test data.
    pub affinity: Vec<Vec<f64>>,
    /// Fraction of the trials whose most likely object was the true one.
    pub accuracy: f64,
    /// Pairs of objects that are nearly equal, most similar first.
    pub near_duplicates: Vec<NearDuplicate>,
}

/// The appearance of all objects of a catalogue.
#[derive(Clone, Debug, PartialEq)]
pub struct AppearanceModel {
    /// The shared classes.
    pub vocabulary: Arc<AppearanceVocabulary>,
    /// The objects, in the order of the catalogue.
    pub objects: Vec<Arc<ObjectAppearance>>,
    /// Number of readings added to every class of every histogram.
    pub smoothing: f64,
    /// Exponent of the likelihoods (of the rule of least divergence) that fits held-out
    /// readings best: touches are correlated.
    pub exponent: f64,
    /// Results on held-out readings.
    pub report: AppearanceReport,
}
