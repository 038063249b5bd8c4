//! Appearance space: the appearance of a touch as a short feature vector.
//!
//! Un-normalised Polar-Fourier and the peak pressure are projected onto the few discriminant
//! axes, along which places differ more than touches of one place (Fisher, 1936), scaled so that
//! the difference of two touches of one place has unit covariance.

use super::agreement::{Feature, N_AXES, StoredFeature};
use super::features::Features;
use palpate_core::descriptor::polar_fourier::{PolarFourier, PolarFourierForm};
use palpate_core::descriptor::{Descriptor, Workspace};
use palpate_core::reading::TactileImage;
use palpate_core::sensor::TaxelGrid;
use palpate_core::units::KPA;
use palpate_core::vocabulary::discriminant::Discriminant;

/// The space in which the touches of a catalogue are compared.
#[derive(Clone, Debug)]
pub struct AppearanceSpace {
    grid: TaxelGrid,
    projection: Discriminant,
    anywhere: Vec<StoredFeature>,
    anywhere_by_axis: Features,
    descriptor: PolarFourier,
}

impl AppearanceSpace {
    /// A space from its parts: the trained sensors' `grid`, the projection (its first
    /// [`N_AXES`] axes count), and features of touches `anywhere` on any object.
    #[must_use]
    pub fn new(grid: TaxelGrid, projection: Discriminant, anywhere: Vec<StoredFeature>) -> Self {
        let descriptor = raw_descriptor(&grid);
        let anywhere_by_axis = Features::new(anywhere.iter());
        Self { grid, projection, anywhere, anywhere_by_axis, descriptor }
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

    /// Density of touches anywhere at a feature, on the scale of
    /// [`kernel`](super::agreement::kernel).
    #[must_use]
    pub fn density_anywhere(&self, feature: &Feature, softness: f32) -> f32 {
        let sum = self.anywhere_by_axis.agreement(feature, softness);
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

/// Projects a raw feature into the space.
#[must_use]
pub fn project(projection: &Discriminant, raw: &[f64]) -> Feature {
    let mut feature = [0.0; N_AXES];
    for (place, value) in feature.iter_mut().zip(projection.project(raw)) {
        *place = value as f32;
    }
    feature
}

/// The descriptor of images on a grid.
#[must_use]
pub fn raw_descriptor(grid: &TaxelGrid) -> PolarFourier {
    PolarFourier::new(grid.rows, grid.cols, PolarFourierForm::Interleaved)
}

/// Number of values of a raw feature of images on a grid.
#[must_use]
pub fn raw_dimension(grid: &TaxelGrid) -> usize {
    raw_descriptor(grid).dimension() + 1
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

/// Resamples an image to another grid with the same centre: the mean over each taxel's square, 0
/// outside the array.
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

/// The pressure at a place of the sensor's plane, interpolated bilinearly between the taxels'
/// centres.
fn at(image: &TactileImage, grid: &TaxelGrid, x: f64, y: f64) -> f64 {
    let (x0, y0) = grid.center(0, 0);
    let (x1, y1) = grid.center(grid.rows - 1, grid.cols - 1);
    let place = |value: f64, first: f64, last: f64, n: usize| {
        if n < 2 { 0.0 } else { (value - first) / (last - first) * (n as f64 - 1.0) }
    };
    let (col, row) = (place(x, x0, x1, grid.cols), place(y, y0, y1, grid.rows));
    // The array extends half a taxel beyond the outermost centres.
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

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_core::units::MM;

    /// 12 mm in `side` × `side` taxels without gaps.
    fn over_12_mm(side: usize) -> TaxelGrid {
        let pitch = 12.0 * MM / side as f64;
        TaxelGrid { rows: side, cols: side, pitch, taxel_width: pitch }
    }

    /// Image of a Gaussian contact off the centre, with standard deviations of 3 mm along x and
    /// 2 mm along y.
    fn blob(grid: &TaxelGrid) -> TactileImage {
        let at = |x: f64, y: f64| {
            let (x, y) = ((x / MM - 0.7) / 3.0, (y / MM + 0.4) / 2.0);
            10.0 * KPA * (-0.5 * (x * x + y * y)).exp()
        };
        let taxels = (0..grid.n_taxels()).map(|n| grid.center(n / grid.cols, n % grid.cols));
        let pressures = taxels.map(|(x, y)| at(x, y)).collect();
        TactileImage { rows: grid.rows, cols: grid.cols, pressures }
    }

    fn mean(image: &TactileImage) -> f64 {
        image.pressures.iter().sum::<f64>() / image.pressures.len() as f64
    }

    /// A projection onto single entries of the raw feature, the peak last.
    fn space(grid: TaxelGrid, anywhere: Vec<StoredFeature>) -> AppearanceSpace {
        let dimension = raw_descriptor(&grid).dimension() + 1;
        let entries = [0, 1, 2, dimension - 1];
        let axis = |entry: usize| (0..dimension).map(|n| f64::from(u8::from(n == entry))).collect();
        let axes = entries.into_iter().map(axis).collect();
        AppearanceSpace::new(grid, Discriminant { mean: vec![0.0; dimension], axes }, anywhere)
    }

    #[test]
    fn density_anywhere_is_the_mean_agreement_and_never_nothing() {
        let feature = [0.0; N_AXES];
        let mut far = [0; N_AXES];
        far[0] = 127;
        let both = space(over_12_mm(6), vec![[0; N_AXES], far]);
        assert!((both.density_anywhere(&feature, 0.6) - 0.5).abs() < 1e-4);
        assert!(space(over_12_mm(6), Vec::new()).density_anywhere(&feature, 0.6) > 0.0);
    }

    #[test]
    fn resampling_to_the_same_taxels_only_smooths() {
        let grid = over_12_mm(6);
        let image = blob(&grid);
        let again = resampled(&image, &grid, &grid);
        for (before, after) in image.pressures.iter().zip(&again.pressures) {
            // A triangle of ±2 mm and a square of 2 mm add a variance of 2/3 + 1/3 mm² to the
            // blob's 9 and 4 mm²: its peak falls to √(9/10 · 4/5) = 0.85.
            assert!((before - after).abs() < 0.16 * image.max(), "{before} {after}");
        }
    }

    #[test]
    fn finer_and_coarser_taxels_keep_the_mean_pressure() {
        let (coarse, fine) = (over_12_mm(6), over_12_mm(14));
        for (from, to) in [(coarse, fine), (fine, coarse)] {
            let image = blob(&from);
            let seen = resampled(&image, &from, &to);
            assert_eq!((seen.rows, seen.cols), (to.rows, to.cols));
            assert!((mean(&seen) / mean(&image) - 1.0).abs() < 0.02);
        }
        let even = TactileImage { rows: 14, cols: 14, pressures: vec![3.0; 196] };
        let seen = resampled(&even, &fine, &coarse);
        assert!(seen.pressures.iter().all(|p| (p - 3.0).abs() < 1e-9), "{seen:?}");
    }

    #[test]
    fn outside_the_array_nothing_is_felt() {
        let grid = over_12_mm(6);
        let wide = TaxelGrid { rows: 10, cols: 10, ..grid };
        let even = TactileImage { rows: 6, cols: 6, pressures: vec![3.0; 36] };
        let seen = resampled(&even, &grid, &wide);
        assert!(seen.at(0, 0).abs() < 1e-12 && (seen.at(5, 5) - 3.0).abs() < 1e-12);
    }

    #[test]
    fn another_sensor_feels_nearly_the_same() {
        let (coarse, fine) = (over_12_mm(6), over_12_mm(14));
        let space = space(coarse, Vec::new());
        let own = space.feature(&blob(&coarse), &coarse);
        let other = space.feature(&blob(&fine), &fine);
        let size = own.iter().map(|value| value.abs()).fold(0.0, f32::max);
        assert!(size > 0.5, "{own:?}");
        for (a, b) in own.iter().zip(&other) {
            assert!((a - b).abs() < 0.1 * size, "{own:?} {other:?}");
        }
    }
}
