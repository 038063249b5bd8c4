//! Fits the point spread to small indentations on a fine grid.
//!
//! Source: section 2.3.2, equations 2.3–2.5 with the corrections in `docs/equations.md`: the
//! forward model is E = S(D ∗ G), a flat cylinder blurred by a Gaussian that sums to 1 and
//! averaged over each taxel's square, gaps between taxels left out; the quality is the mean
//! cosine of the L2-normalised images. Lengths in metres in the sensor frame.

use libm::erf;
use thiserror::Error;

use super::grid::TaxelGrid;

/// Range of candidate spreads, in element widths.
const SPREADS: (f64, f64) = (0.1, 8.0);
/// Number of spreads in the scan that brackets the maximum.
const N_SCANNED: usize = 36;
/// Number of golden-section steps: each leaves 0.618 of the bracket, 40 of them 4e-9.
const N_GOLDEN: usize = 40;
/// Number of strips along x into which the indenter's disc is cut.
const N_STRIPS: usize = 10;

/// A flat cylinder, pressed end first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Indenter {
    /// Diameter, metres.
    pub diameter: f64,
}

/// One press of the grid.
#[derive(Clone, Debug, PartialEq)]
pub struct SpreadPress {
    /// Position of the indenter's axis on the covering, metres in the sensor frame: (x, y).
    pub at: (f64, f64),
    /// The corrected image, Pa, row-major, without the response's offset; `None` for a taxel
    /// without a value.
    pub pressures: Vec<Option<f64>>,
}

/// A fitted point spread.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpreadFit {
    /// Standard deviation of the Gaussian, metres.
    pub sigma: f64,
    /// Standard deviation in element widths.
    pub sigma_in_widths: f64,
    /// Mean cosine of the measured and modelled images (equation 2.3, normalised).
    pub cosine: f64,
    /// Mean Pearson correlation of these images.
    pub pearson: f64,
}

/// Error of presses that give no point spread.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum SpreadError {
    /// There are no presses.
    #[error("no presses came, expected at least one")]
    Empty,
    /// An image has the wrong size.
    #[error("press {press} has {found} taxels, expected {expected}")]
    Shape {
        /// Index of the press.
        press: usize,
        /// Values in the image.
        found: usize,
        /// Taxels of the sensor.
        expected: usize,
    },
    /// An image is zero or missing everywhere.
    #[error("press {press} shows nothing in any taxel that can be used")]
    Silent {
        /// Index of the press.
        press: usize,
    },
    /// The best spread lies at an end of the range.
    #[error(
        "the best spread is {sigma} m, at the end of what is tried ({low} to {high} m): are the \
         places of the presses in metres in the sensor's frame?"
    )]
    AtEnd {
        /// The spread.
        sigma: f64,
        /// Lower end of the range.
        low: f64,
        /// Upper end of the range.
        high: f64,
    },
}

/// The image of a press one metre deep: blurred displacement averaged over each taxel,
/// metres, row-major; multiply it by the depth. `sigma` and the position `at` in metres.
#[must_use]
pub fn indentation_image(
    grid: &TaxelGrid,
    sigma: f64,
    indenter: Indenter,
    at: (f64, f64),
) -> Vec<f64> {
    let radius = 0.5 * indenter.diameter;
    let strip_width = 2.0 * radius / N_STRIPS as f64;
    let mut image = vec![0.0; grid.n_taxels()];
    for strip in 0..N_STRIPS {
        // A strip along y at its middle's chord; the exact area is restored below.
        let x = -radius + (strip as f64 + 0.5) * strip_width;
        let half = (radius * radius - x * x).sqrt();
        let along_x = box_over_taxels(grid, grid.cols, sigma, at.0 + x, 0.5 * strip_width);
        let along_y = box_over_taxels(grid, grid.rows, sigma, at.1, half);
        for (row, y) in image.chunks_exact_mut(grid.cols).zip(&along_y) {
            row.iter_mut().zip(&along_x).for_each(|(sum, x)| *sum += x * y);
        }
    }
    let strips: f64 = (0..N_STRIPS)
        .map(|strip| {
            let x = -radius + (strip as f64 + 0.5) * strip_width;
            2.0 * (radius * radius - x * x).sqrt() * strip_width
        })
        .sum();
    let exact = std::f64::consts::PI * radius * radius / strips;
    image.iter_mut().for_each(|value| *value *= exact);
    image
}

/// Along one axis: the blurred box of half width `half` at `at`, averaged over each taxel.
fn box_over_taxels(grid: &TaxelGrid, n: usize, sigma: f64, at: f64, half: f64) -> Vec<f64> {
    let average = |taxel: usize| {
        let center = (taxel as f64 - (n as f64 - 1.0) / 2.0) * grid.pitch;
        let (low, high) =
            (center - 0.5 * grid.taxel_width - at, center + 0.5 * grid.taxel_width - at);
        // ∫ over the taxel of Φ((u + half)/σ) − Φ((u − half)/σ) du.
        let integral = |u: f64| ramp(u + half, sigma) - ramp(u - half, sigma);
        (integral(high) - integral(low)) / grid.taxel_width
    };
    (0..n).map(average).collect()
}

/// The integral of the normal distribution function: u Φ(u/σ) + σ φ(u/σ).
fn ramp(u: f64, sigma: f64) -> f64 {
    let z = u / sigma;
    let phi = (-0.5 * z * z).exp() / std::f64::consts::TAU.sqrt();
    u * 0.5 * (1.0 + erf(z * std::f64::consts::FRAC_1_SQRT_2)) + sigma * phi
}

/// The cosine of the angle between two images; 0 when one is zero everywhere.
#[must_use]
pub fn cosine(a: &[f64], b: &[f64]) -> f64 {
    let dot = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(x, y)| x * y).sum() };
    let norms = (dot(a, a) * dot(b, b)).sqrt();
    if norms > 0.0 { dot(a, b) / norms } else { 0.0 }
}

/// Pearson's correlation of two images; 0 when one is constant.
#[must_use]
pub fn pearson(a: &[f64], b: &[f64]) -> f64 {
    let centered = |values: &[f64]| -> Vec<f64> {
        let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
        values.iter().map(|value| value - mean).collect()
    };
    cosine(&centered(a), &centered(b))
}

/// Fits the Gaussian's standard deviation to presses of `indenter` (equations 2.3–2.4).
///
/// # Errors
/// [`SpreadError`] names the invalid press.
pub fn fit_spread(
    grid: &TaxelGrid,
    indenter: Indenter,
    presses: &[SpreadPress],
) -> Result<SpreadFit, SpreadError> {
    let measured = check(grid, presses)?;
    let quality = |sigma: f64| mean_of(cosine, grid, indenter, &measured, sigma);
    let (low, high) = (SPREADS.0 * grid.pitch, SPREADS.1 * grid.pitch);
    let step = (high / low).powf(1.0 / (N_SCANNED - 1) as f64);
    let scanned = |index: usize| low * step.powi(index as i32);
    let qualities: Vec<f64> = (0..N_SCANNED).map(|index| quality(scanned(index))).collect();
    let best = (0..N_SCANNED).max_by(|a, b| qualities[*a].total_cmp(&qualities[*b])).unwrap_or(0);
    if best == 0 || best == N_SCANNED - 1 {
        return Err(SpreadError::AtEnd { sigma: scanned(best), low, high });
    }
    let sigma = golden_maximum(quality, scanned(best - 1), scanned(best + 1));
    Ok(SpreadFit {
        sigma,
        sigma_in_widths: sigma / grid.pitch,
        cosine: quality(sigma),
        pearson: mean_of(pearson, grid, indenter, &measured, sigma),
    })
}

/// The maximum of a unimodal function within `low ..= high`, by golden section.
pub fn golden_maximum(value: impl Fn(f64) -> f64, low: f64, high: f64) -> f64 {
    let share = 0.5 * (5f64.sqrt() - 1.0);
    let (mut low, mut high) = (low, high);
    let (mut left, mut right) = (high - share * (high - low), low + share * (high - low));
    let (mut at_left, mut at_right) = (value(left), value(right));
    for _ in 0..N_GOLDEN {
        if at_left >= at_right {
            (high, right, at_right) = (right, left, at_left);
            left = high - share * (high - low);
            at_left = value(left);
        } else {
            (low, left, at_left) = (left, right, at_right);
            right = low + share * (high - low);
            at_right = value(right);
        }
    }
    0.5 * (low + high)
}

/// A press's usable taxels and their values.
struct Usable {
    at: (f64, f64),
    taxels: Vec<usize>,
    values: Vec<f64>,
}

fn check(grid: &TaxelGrid, presses: &[SpreadPress]) -> Result<Vec<Usable>, SpreadError> {
    if presses.is_empty() {
        return Err(SpreadError::Empty);
    }
    let one = |(press, given): (usize, &SpreadPress)| {
        let (found, expected) = (given.pressures.len(), grid.n_taxels());
        if found != expected {
            return Err(SpreadError::Shape { press, found, expected });
        }
        let values = given.pressures.iter().enumerate();
        let (taxels, values): (Vec<usize>, Vec<f64>) =
            values.filter_map(|(taxel, value)| value.map(|value| (taxel, value))).unzip();
        if values.iter().all(|value| *value <= 0.0) {
            return Err(SpreadError::Silent { press });
        }
        Ok(Usable { at: given.at, taxels, values })
    };
    presses.iter().enumerate().map(one).collect()
}

fn mean_of(
    similarity: fn(&[f64], &[f64]) -> f64,
    grid: &TaxelGrid,
    indenter: Indenter,
    measured: &[Usable],
    sigma: f64,
) -> f64 {
    let sum: f64 = measured
        .iter()
        .map(|press| {
            let image = indentation_image(grid, sigma, indenter, press.at);
            let modelled: Vec<f64> = press.taxels.iter().map(|taxel| image[*taxel]).collect();
            similarity(&press.values, &modelled)
        })
        .sum();
    sum / measured.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::MM;

    const GRID: TaxelGrid = TaxelGrid { rows: 6, cols: 6, pitch: 2.0 * MM, taxel_width: 1.8 * MM };
    const INDENTER: Indenter = Indenter { diameter: 1.0 * MM };

    #[test]
    fn a_wide_indenter_displaces_every_taxel_by_its_depth() {
        let image = indentation_image(&GRID, 1.0 * MM, Indenter { diameter: 0.2 }, (0.0, 0.0));
        assert!(image.iter().all(|value| (value - 1.0).abs() < 0.01), "{image:?}");
    }

    #[test]
    fn the_kernel_sums_to_one_and_gaps_are_left_out() {
        // Over a wide array without gaps the image's integral is the disc's area.
        let grid = TaxelGrid { rows: 40, cols: 40, pitch: 1.0 * MM, taxel_width: 1.0 * MM };
        let volume = |grid: &TaxelGrid| {
            let image = indentation_image(grid, 2.0 * MM, INDENTER, (0.3 * MM, -0.2 * MM));
            image.iter().sum::<f64>() * grid.taxel_width.powi(2)
        };
        let area = std::f64::consts::PI * (0.5 * MM).powi(2);
        assert!((volume(&grid) / area - 1.0).abs() < 1e-6);
        // Taxels of 0.8 mm at the same pitch sense 64 % of it.
        let gaps = TaxelGrid { taxel_width: 0.8 * MM, ..grid };
        assert!((volume(&gaps) / area / 0.64 - 1.0).abs() < 0.01);
    }

    #[test]
    fn the_exact_model_agrees_with_fine_sampling() {
        // The oracle: the disc and each taxel sampled 60 × 60 and 20 × 20, summed plainly.
        let (sigma, at) = (0.9 * MM, (0.4 * MM, -1.3 * MM));
        let image = indentation_image(&GRID, sigma, INDENTER, at);
        let spots = |n: usize, width: f64| -> Vec<f64> {
            (0..n).map(|k| ((k as f64 + 0.5) / n as f64 - 0.5) * width).collect()
        };
        let (disc, square) = (spots(60, 1.0 * MM), spots(20, 1.8 * MM));
        for taxel in [14, 15, 20, 21] {
            let (x, y) = GRID.center(taxel / 6, taxel % 6);
            let mut sum = 0.0;
            for (u, v) in disc.iter().flat_map(|u| disc.iter().map(move |v| (u, v))) {
                if u * u + v * v > (0.5 * MM).powi(2) {
                    continue;
                }
                for (p, q) in square.iter().flat_map(|p| square.iter().map(move |q| (p, q))) {
                    let (dx, dy) = (x + p - at.0 - u, y + q - at.1 - v);
                    sum += (-(dx * dx + dy * dy) / (2.0 * sigma * sigma)).exp();
                }
            }
            let cell = (1.0 * MM / 60.0).powi(2) / 400.0;
            let expected = sum * cell / (std::f64::consts::TAU * sigma * sigma);
            assert!((image[taxel] / expected - 1.0).abs() < 0.01, "{taxel}");
        }
    }

    #[test]
    fn the_fit_recovers_the_spread_of_the_images() {
        for widths in [0.8, 1.3625, 2.372] {
            let sigma = widths * GRID.pitch;
            let mut presses = Vec::new();
            for (u, v) in (0..5).flat_map(|u| (0..5).map(move |v| (u, v))) {
                let at = (1e-3 + (f64::from(u) - 2.0) * 3e-4, 1e-3 + (f64::from(v) - 2.0) * 3e-4);
                let image = indentation_image(&GRID, sigma, INDENTER, at);
                let mut pressures: Vec<Option<f64>> =
                    image.iter().map(|value| Some(7e5 * value)).collect();
                pressures[3] = None;
                presses.push(SpreadPress { at, pressures });
            }
            let fit = fit_spread(&GRID, INDENTER, &presses).unwrap();
            assert!((fit.sigma_in_widths - widths).abs() < 1e-4, "{widths}: {fit:?}");
            assert!((fit.cosine - 1.0).abs() < 1e-9 && (fit.pearson - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn invalid_presses_are_refused_by_index() {
        let press = |values: Vec<Option<f64>>| SpreadPress { at: (0.0, 0.0), pressures: values };
        let fit = |presses: &[SpreadPress]| fit_spread(&GRID, INDENTER, presses).unwrap_err();
        assert_eq!(fit(&[]), SpreadError::Empty);
        let silent = [press(vec![Some(1.0); 36]), press(vec![None; 36])];
        assert_eq!(fit(&silent), SpreadError::Silent { press: 1 });
        let short = SpreadError::Shape { press: 0, found: 35, expected: 36 };
        assert_eq!(fit(&[press(vec![Some(1.0); 35])]), short);
        assert!(matches!(fit(&[press(vec![Some(1.0); 36])]), SpreadError::AtEnd { .. }));
    }

    #[test]
    fn similarities_match_hand_computed_values() {
        assert!((cosine(&[1.0, 0.0], &[1.0, 1.0]) - 0.5f64.sqrt()).abs() < 1e-12);
        assert!((pearson(&[1.0, 2.0, 3.0], &[5.0, 3.0, 1.0]) + 1.0).abs() < 1e-12);
    }
}
