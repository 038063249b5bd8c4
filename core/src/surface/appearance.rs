//! Appearance space: what a touch looks like, in a few numbers, and how well two touches agree.
//!
//! Un-normalised Polar-Fourier and the peak pressure are projected onto the few axes along
//! which places differ more than touches of one place (Fisher, 1936), scaled so that two
//! touches of one place differ with covariance 1. Touches of one place agree far better than
//! that in the most cases and far worse at edges, hence the heavy tails of [`kernel`].

use crate::descriptor::polar_fourier::{PolarFourier, PolarFourierForm};
use crate::descriptor::{Descriptor, Workspace};
use crate::reading::TactileImage;
use crate::sensor::TaxelGrid;
use crate::units::KPA;
use crate::vocabulary::discriminant::Discriminant;

/// The most axes of the space.
pub const N_AXES: usize = 8;

/// A feature: coordinates in the space, in deviations of two touches of one place.
pub type Feature = [f32; N_AXES];

/// A stored feature, in steps of 1/[`STEPS`].
pub type StoredFeature = [i8; N_AXES];

/// Steps of a stored feature to one deviation.
const STEPS: f32 = 16.0;

/// The share of touches whose appearance is anything: no look-up says "impossible".
const OUTLIERS: f32 = 0.05;

/// The space in which the touches of a catalogue are compared.
#[derive(Clone, Debug)]
pub struct AppearanceSpace {
    grid: TaxelGrid,
    projection: Discriminant,
    anywhere: Vec<StoredFeature>,
    descriptor: PolarFourier,
}

impl AppearanceSpace {
    /// A space from its parts: the trained sensors' `grid`, the projection (its first
    /// [`N_AXES`] axes count), and features of touches `anywhere` on any object.
    #[must_use]
    pub fn new(grid: TaxelGrid, projection: Discriminant, anywhere: Vec<StoredFeature>) -> Self {
        let descriptor = raw_descriptor(&grid);
        Self { grid, projection, anywhere, descriptor }
    }

    /// Features of touches anywhere on any object.
    #[must_use]
    pub fn anywhere(&self) -> &[StoredFeature] {
        &self.anywhere
    }

    /// The projection of raw features.
    #[must_use]
    pub fn projection(&self) -> &Discriminant {
        &self.projection
    }

    /// The taxels that the space was learnt on; other sensors' images are resampled to them.
    #[must_use]
    pub fn grid(&self) -> &TaxelGrid {
        &self.grid
    }

    /// The feature of an image taken by taxels on `grid`.
    #[must_use]
    pub fn feature(&self, image: &TactileImage, grid: &TaxelGrid) -> Feature {
        let raw = if grid == &self.grid {
            raw_feature(&self.descriptor, image)
        } else {
            raw_feature(&self.descriptor, &resampled(image, grid, &self.grid))
        };
        project(&self.projection, &raw)
    }

    /// How dense touches anywhere are at a feature, on the scale of [`kernel`].
    #[must_use]
    pub fn density_anywhere(&self, feature: &Feature, softness: f32) -> f32 {
        let sum: f32 = self.anywhere.iter().map(|other| kernel(feature, other, softness)).sum();
        (sum / self.anywhere.len().max(1) as f32).max(f32::MIN_POSITIVE)
    }
}

impl PartialEq for AppearanceSpace {
    fn eq(&self, other: &Self) -> bool {
        self.grid == other.grid
            && self.projection == other.projection
            && self.anywhere == other.anywhere
    }
}

/// The feature of a raw feature.
#[must_use]
pub fn project(projection: &Discriminant, raw: &[f64]) -> Feature {
    let mut feature = [0.0; N_AXES];
    for (place, value) in feature.iter_mut().zip(projection.project(raw)) {
        *place = value as f32;
    }
    feature
}

/// A feature as it is stored; beyond ±8 deviations it stays at the end of the range.
#[must_use]
pub fn stored(feature: &Feature) -> StoredFeature {
    feature.map(|value| (value * STEPS).round() as i8)
}

/// How well two touches agree: Student's t with three degrees of freedom in eight dimensions,
/// not normalised; `softness` scales the variance.
#[inline]
#[must_use]
pub fn kernel(feature: &Feature, other: &StoredFeature, softness: f32) -> f32 {
    let mut square = 0.0;
    for (value, stored) in feature.iter().zip(other) {
        let difference = value - f32::from(*stored) * (1.0 / STEPS);
        square += difference * difference;
    }
    let inverse = (1.0 + square / (3.0 * softness)).recip();
    // The exponent is (3 + 8) / 2 = 5½.
    let squared = inverse * inverse;
    squared * squared * inverse * inverse.sqrt()
}

/// How much likelier a feature is where `other` was felt than anywhere; `density` is that of
/// [`AppearanceSpace::density_anywhere`].
#[inline]
#[must_use]
pub fn ratio(feature: &Feature, other: &StoredFeature, softness: f32, density: f32) -> f32 {
    (1.0 - OUTLIERS) * kernel(feature, other, softness) / density + OUTLIERS
}

/// The descriptor of images on a grid.
#[must_use]
pub fn raw_descriptor(grid: &TaxelGrid) -> PolarFourier {
    PolarFourier::new(grid.rows, grid.cols, PolarFourierForm::Interleaved)
}

/// The raw feature of an image: its magnitudes and its peak, in units of 10 kPa.
#[must_use]
pub fn raw_feature(descriptor: &PolarFourier, image: &TactileImage) -> Vec<f64> {
    let mut feature = vec![0.0; descriptor.dimension()];
    descriptor.write(image, &mut Workspace::default(), &mut feature);
    feature.push(image.max());
    feature.iter_mut().for_each(|value| *value /= 10.0 * KPA);
    feature
}

/// An image as taxels on another grid about the same centre would have read it: the mean over
/// each taxel's square, 0 outside the array.
#[must_use]
pub fn resampled(image: &TactileImage, from: &TaxelGrid, to: &TaxelGrid) -> TactileImage {
    const SAMPLES: usize = 4;
    let mut pressures = Vec::with_capacity(to.rows * to.cols);
    for row in 0..to.rows {
        for col in 0..to.cols {
            let (x, y) = to.center(row, col);
            let mut sum = 0.0;
            for sample in 0..SAMPLES * SAMPLES {
                let shift = |n: usize| ((n as f64 + 0.5) / SAMPLES as f64 - 0.5) * to.taxel_width;
                sum += at(image, from, x + shift(sample % SAMPLES), y + shift(sample / SAMPLES));
            }
            pressures.push(sum / (SAMPLES * SAMPLES) as f64);
        }
    }
    TactileImage { rows: to.rows, cols: to.cols, pressures }
}

/// The pressure at a place of the sensor's plane, between the taxels' centres bilinear.
fn at(image: &TactileImage, grid: &TaxelGrid, x: f64, y: f64) -> f64 {
    let (x0, y0) = grid.center(0, 0);
    let (x1, y1) = grid.center(grid.rows - 1, grid.cols - 1);
    let place = |value: f64, first: f64, last: f64, n: usize| {
        if n < 2 { 0.0 } else { (value - first) / (last - first) * (n as f64 - 1.0) }
    };
    let (col, row) = (place(x, x0, x1, grid.cols), place(y, y0, y1, grid.rows));
    // Half a taxel beyond the outermost centres still is the array.
    let inside = |place: f64, n: usize| (-0.5..=n as f64 - 0.5).contains(&place);
    if !inside(col, grid.cols) || !inside(row, grid.rows) {
        return 0.0;
    }
    let clamped = |place: f64, n: usize| place.clamp(0.0, n as f64 - 1.0);
    let (col, row) = (clamped(col, grid.cols), clamped(row, grid.rows));
    let (c, r) = (col.floor() as usize, row.floor() as usize);
    let (dc, dr) = (col - c as f64, row - r as f64);
    let (c1, r1) = ((c + 1).min(grid.cols - 1), (r + 1).min(grid.rows - 1));
    (1.0 - dr) * ((1.0 - dc) * image.at(r, c) + dc * image.at(r, c1))
        + dr * ((1.0 - dc) * image.at(r1, c) + dc * image.at(r1, c1))
}
