//! Descriptors: features of tactile images, as vectors of unit length.
//!
//! Source: section 4.3.2; open points are settled in `docs/equations.md`. A descriptor is
//! planned once for a shape of images ([`DescriptorKind::plan`]) and then turns batches of
//! images into a [`FeatureMatrix`]. Angles turn from the columns' direction (+x) to the rows'
//! (+y); the diameter of the inscribed circle is the shorter side of the image. Not here:
//! classes of appearance (`vocabulary`).

pub mod exhaustive;
pub mod feature_matrix;
pub mod kind;
pub mod mnti;
pub mod moment_normalized;
pub mod mr8;
pub mod polar_fourier;
pub mod polar_spectrum;
pub mod schmid;
pub mod sift;
pub mod steerable;
pub mod vectorize;

mod disc;
mod filter_bank;
mod fourier;
mod sample;
#[cfg(test)]
mod test_support;

pub use feature_matrix::FeatureMatrix;
pub use kind::DescriptorKind;

use rayon::prelude::*;
use rustfft::num_complex::Complex;

use crate::reading::TactileImage;

/// Number of images per parallel task.
const CHUNK: usize = 64;

/// A planned descriptor for tactile images of one shape, with its tables and transforms.
///
/// Laws: an image's features depend on that image alone; scaling an image by a positive
/// factor keeps its features; each feature has norm 1, or is all zeros without contact (for
/// SIFT, which uses the gradient: where the image is constant).
pub trait Descriptor: Send + Sync {
    /// Rows and columns of the images.
    fn shape(&self) -> (usize, usize);

    /// Length of a feature.
    fn dimension(&self) -> usize;

    /// Number of features of an image.
    fn features_per_image(&self) -> usize {
        1
    }

    /// Writes the unnormalised features of an image of the planned shape, one after the
    /// other. Allocates nothing once the workspace has grown.
    fn write(&self, image: &TactileImage, workspace: &mut Workspace, features: &mut [f64]);

    /// Describes a batch. Rows are the features in the order of the images; the owner of a
    /// row is its image's index. The result does not depend on the number of threads.
    ///
    /// # Panics
    /// When an image does not have the planned shape.
    fn describe(&self, images: &[&TactileImage]) -> FeatureMatrix {
        let shape = self.shape();
        let fits = images.iter().all(|image| (image.rows, image.cols) == shape);
        assert!(fits, "every image is {} × {} taxels, as planned", shape.0, shape.1);
        let (dimension, per_image) = (self.dimension(), self.features_per_image());
        let stride = dimension * per_image;
        let mut values = vec![0.0; images.len() * stride];
        let write_all = |workspace: &mut Workspace, chunk: (&mut [f64], &[&TactileImage])| {
            let (rows, images) = chunk;
            for (features, image) in rows.chunks_exact_mut(stride).zip(images) {
                self.write(image, workspace, features);
                features.chunks_exact_mut(dimension).for_each(normalize);
            }
        };
        if images.len() <= CHUNK {
            // A session's reading does not queue behind a training's.
            write_all(&mut Workspace::default(), (values.as_mut_slice(), images));
        } else {
            let chunks = values.par_chunks_mut(CHUNK * stride).zip(images.par_chunks(CHUNK));
            chunks.for_each_init(Workspace::default, write_all);
        }
        let owners = (0..images.len() * per_image).map(|row| row / per_image).collect();
        FeatureMatrix::from_parts(dimension, values, owners)
    }
}

/// Buffers that descriptors reuse from image to image.
#[derive(Debug, Default)]
pub struct Workspace {
    reals: Vec<f64>,
    complexes: Vec<Complex<f64>>,
}

impl Workspace {
    /// Buffers of the given lengths, with arbitrary content.
    fn lend(&mut self, n_reals: usize, n_complexes: usize) -> (&mut [f64], &mut [Complex<f64>]) {
        if self.reals.len() < n_reals {
            self.reals.resize(n_reals, 0.0);
        }
        if self.complexes.len() < n_complexes {
            self.complexes.resize(n_complexes, Complex::default());
        }
        (&mut self.reals[..n_reals], &mut self.complexes[..n_complexes])
    }
}

/// Scales a vector to norm 1; a vector of (nearly) zero length becomes zeros.
pub fn normalize(vector: &mut [f64]) {
    let norm = vector.iter().map(|value| value * value).sum::<f64>().sqrt();
    let scale = if norm > 1e-12 { norm.recip() } else { 0.0 };
    vector.iter_mut().for_each(|value| *value *= scale);
}

/// The affinity of two features: their inner product, clamped to −1 ..= 1 (section 5.3.2).
#[must_use]
pub fn affinity(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>().clamp(-1.0, 1.0)
}
