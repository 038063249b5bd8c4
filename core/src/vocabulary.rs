//! The vocabulary of touch: appearance classes and their features.
//!
//! Source: section 5.3.2, equations 5.15–5.19. A vocabulary is learnt once and shared by
//! every object of a catalogue. Features are relative to the training mean and normalised
//! again, so that affinities use the whole range of −1 ..= 1 (see `docs/equations.md`, rows
//! of 4.3.2 and 5.3.2).

pub mod association;
pub mod bag;
pub mod choice;
pub mod discriminant;
pub mod gmm;
pub mod kmeans;
pub mod labelled;
pub mod medoids;
pub mod pca;

pub use association::{Association, AssociationRule};

use crate::descriptor::{DescriptorKind, affinity, normalize};
use crate::reading::TactileImage;

/// Smallest variance of a class (equation 5.15 gives 0 for singletons).
pub const MIN_SPREAD: f64 = 1e-4;

/// An appearance class of a vocabulary, by its index.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ClassIdx(pub u8);

/// Maximum number of classes of a vocabulary: a [`ClassIdx`] is one byte.
pub const MAX_CLASSES: usize = 255;

/// Appearance classes by their medoids, for images of one shape.
#[derive(Clone, Debug, PartialEq)]
pub struct Vocabulary {
    /// Descriptor of the images; it gives each reading one feature.
    pub descriptor: DescriptorKind,
    /// Rows of the images.
    pub rows: usize,
    /// Columns of the images.
    pub cols: usize,
    /// The mean descriptor of the training set, subtracted before comparing.
    pub mean: Vec<f64>,
    /// One feature of norm 1 for each class.
    pub medoids: Vec<Vec<f64>>,
    /// ψ of each class (equation 5.15), at least [`MIN_SPREAD`].
    pub spreads: Vec<f64>,
}

impl Vocabulary {
    /// The number of appearance classes.
    #[must_use]
    pub fn n_classes(&self) -> usize {
        self.medoids.len()
    }

    /// Whether an image has the vocabulary's shape.
    #[must_use]
    pub fn fits(&self, image: &TactileImage) -> bool {
        (image.rows, image.cols) == (self.rows, self.cols)
    }

    /// The feature of an image: its descriptor relative to the mean, norm 1.
    #[must_use]
    pub fn feature(&self, image: &TactileImage) -> Vec<f64> {
        center(self.descriptor.describe(image).row(0).to_vec(), &self.mean)
    }

    /// The class whose medoid is nearest to a feature; ties go to the lower index.
    #[must_use]
    pub fn nearest(&self, feature: &[f64]) -> ClassIdx {
        let affinities = self.medoids.iter().map(|medoid| affinity(feature, medoid));
        let best = affinities
            .enumerate()
            .fold(
                (0, f64::NEG_INFINITY),
                |best, (class, value)| {
                    if value > best.1 { (class, value) } else { best }
                },
            )
            .0;
        ClassIdx(best as u8)
    }

    /// The classes a feature may belong to, with weights that sum to 1.
    #[must_use]
    pub fn associate(&self, feature: &[f64], rule: AssociationRule) -> Vec<Association> {
        association::associate(feature, &self.medoids, &self.spreads, rule)
    }
}

/// A descriptor relative to a mean, normalised again.
#[must_use]
pub fn center(mut descriptor: Vec<f64>, mean: &[f64]) -> Vec<f64> {
    descriptor.iter_mut().zip(mean).for_each(|(value, mean)| *value -= mean);
    normalize(&mut descriptor);
    descriptor
}
