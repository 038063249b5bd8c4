//! Fits a calibration to indentations: every taxel pressed at its centre to several depths.
//!
//! Source: section 2.2. A taxel is excluded when it does not respond to presses on it: dead
//! when it responds to none, cross-wired when it responds more to those on another taxel.
//! Under a blurring covering neighbours respond too, so a taxel's own responses are compared
//! with each other (its gain cancels), never with those of its neighbours. Depths in metres,
//! pressures in pascal, images row-major. Not here: applying the calibration (`calibration`).

use thiserror::Error;

use super::calibration::{Calibration, CalibrationError, TaxelResponse, TaxelState};
use super::grid::TaxelGrid;
use super::line::{Goodness, Line};

/// Fraction of the median slope below which a taxel is dead.
const DEAD_SHARE: f64 = 0.2;
/// Relative margin by which the response to another taxel's presses must be larger, besides
/// [`CROSS_DEVIATIONS`] standard errors.
const CROSS_MARGIN: f64 = 0.05;
/// Margin in standard errors of the difference of two slopes.
const CROSS_DEVIATIONS: f64 = 3.0;

/// One press at the centre of a taxel.
#[derive(Clone, Debug, PartialEq)]
pub struct Indentation {
    /// Row-major index of the pressed taxel.
    pub taxel: usize,
    /// Depth, metres.
    pub depth: f64,
    /// The image, Pa, row-major; `None` for a taxel without a value.
    pub pressures: Vec<Option<f64>>,
}

/// A calibration and the quality of its fit.
#[derive(Clone, Debug, PartialEq)]
pub struct ResponseFit {
    /// The calibration.
    pub calibration: Calibration,
    /// Responses of the usable taxels as measured, against the target line.
    pub before: Goodness,
    /// The same responses after the correction.
    pub after: Goodness,
}

/// Error of indentations that give no calibration.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum ResponseError {
    /// A press names a taxel that does not exist.
    #[error("press {press} is of taxel {taxel}, expected below {n_taxels}")]
    Taxel {
        /// Index of the press.
        press: usize,
        /// The given index.
        taxel: usize,
        /// Number of taxels.
        n_taxels: usize,
    },
    /// A depth is out of range.
    #[error("press {press} is {depth} m deep, expected a finite number above 0")]
    Depth {
        /// Index of the press.
        press: usize,
        /// The given depth.
        depth: f64,
    },
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
    /// A taxel was not pressed to two different depths.
    #[error(
        "the taxel in row {row}, column {col} was not pressed to two different depths: press \
         every taxel, best to five depths"
    )]
    Depths {
        /// Row of the taxel.
        row: usize,
        /// Column of the taxel.
        col: usize,
    },
    /// Fewer than half of the taxels respond to presses on them.
    #[error(
        "only {usable} of {n_taxels} taxels answer their own presses, expected at least half: \
         are the taxels numbered as in the sensor's frame?"
    )]
    Silent {
        /// Number of responding taxels.
        usable: usize,
        /// Number of taxels.
        n_taxels: usize,
    },
    /// The fitted responses do not rise.
    #[error(transparent)]
    Fit(#[from] CalibrationError),
}

/// Fits a calibration. Values at or above `saturation` (Pa) are left out.
///
/// # Errors
/// [`ResponseError`] names the first invalid press or taxel.
pub fn fit_response(
    presses: &[Indentation],
    grid: &TaxelGrid,
    saturation: f64,
) -> Result<ResponseFit, ResponseError> {
    let by_taxel = by_taxel(presses, grid)?;
    let measured = Measured { presses, by_taxel, saturation };
    let own: Vec<Option<Line>> =
        (0..grid.n_taxels()).map(|taxel| Line::fit(&measured.points(taxel, taxel))).collect();
    let mut slopes: Vec<f64> = own.iter().flatten().map(|line| line.slope).collect();
    slopes.sort_by(f64::total_cmp);
    let floor = DEAD_SHARE * slopes.get(slopes.len() / 2).copied().unwrap_or(0.0).max(0.0);
    let taxels: Vec<TaxelResponse> = own
        .iter()
        .enumerate()
        .map(|(taxel, line)| {
            let line = line.unwrap_or(Line { slope: 0.0, offset: 0.0 });
            let r_squared = line.goodness(&measured.points(taxel, taxel)).r_squared;
            TaxelResponse { line, r_squared, state: measured.state(taxel, &line, floor, grid) }
        })
        .collect();
    let is_usable = |taxel: &usize| taxels[*taxel].state == TaxelState::Ok;
    let usable: Vec<usize> = (0..taxels.len()).filter(is_usable).collect();
    if 2 * usable.len() < taxels.len() {
        return Err(ResponseError::Silent { usable: usable.len(), n_taxels: taxels.len() });
    }
    let pooled: Vec<(f64, f64)> =
        usable.iter().flat_map(|taxel| measured.points(*taxel, *taxel)).collect();
    let target = Line::fit(&pooled).ok_or(CalibrationError::Target { slope: 0.0 })?;
    let calibration = Calibration::new(target, taxels)?;
    let corrected: Vec<(f64, f64)> = usable
        .iter()
        .flat_map(|&taxel| {
            let points = measured.points(taxel, taxel).into_iter();
            points.map(|(depth, p)| (depth, calibration.corrected(taxel, p))).collect::<Vec<_>>()
        })
        .collect();
    let (before, after) = (target.goodness(&pooled), target.goodness(&corrected));
    Ok(ResponseFit { calibration, before, after })
}

/// The indices of each taxel's presses.
fn by_taxel(presses: &[Indentation], grid: &TaxelGrid) -> Result<Vec<Vec<usize>>, ResponseError> {
    let n_taxels = grid.n_taxels();
    let mut by_taxel = vec![Vec::new(); n_taxels];
    for (press, Indentation { taxel, depth, pressures }) in presses.iter().enumerate() {
        let (taxel, depth) = (*taxel, *depth);
        if taxel >= n_taxels {
            return Err(ResponseError::Taxel { press, taxel, n_taxels });
        }
        if !(depth.is_finite() && depth > 0.0) {
            return Err(ResponseError::Depth { press, depth });
        }
        if pressures.len() != n_taxels {
            let found = pressures.len();
            return Err(ResponseError::Shape { press, found, expected: n_taxels });
        }
        by_taxel[taxel].push(press);
    }
    let one_depth = by_taxel.iter().position(|own: &Vec<usize>| {
        let points: Vec<(f64, f64)> =
            own.iter().map(|press| (presses[*press].depth, 0.0)).collect();
        Line::fit(&points).is_none()
    });
    match one_depth {
        Some(taxel) => {
            Err(ResponseError::Depths { row: taxel / grid.cols, col: taxel % grid.cols })
        }
        None => Ok(by_taxel),
    }
}

/// The measurements, by pressed taxel.
struct Measured<'a> {
    presses: &'a [Indentation],
    by_taxel: Vec<Vec<usize>>,
    saturation: f64,
}

impl Measured<'_> {
    /// Depths and the pressures that `taxel` reports while `pressed` is pressed.
    fn points(&self, taxel: usize, pressed: usize) -> Vec<(f64, f64)> {
        let point = |press: &usize| {
            let press = &self.presses[*press];
            let pressure = press.pressures[taxel].filter(|p| *p < self.saturation)?;
            Some((press.depth, pressure))
        };
        self.by_taxel[pressed].iter().filter_map(point).collect()
    }

    fn state(&self, taxel: usize, own: &Line, floor: f64, grid: &TaxelGrid) -> TaxelState {
        let own_error = self.slope_error(taxel, taxel, own);
        let mut best: Option<(usize, f64)> = None;
        for pressed in neighbors(taxel, grid) {
            let Some(line) = Line::fit(&self.points(taxel, pressed)) else { continue };
            let error = own_error.hypot(self.slope_error(taxel, pressed, &line));
            let more = line.slope - own.slope;
            let is_more = line.slope > floor
                && more > CROSS_MARGIN * line.slope
                && more > CROSS_DEVIATIONS * error;
            if is_more && best.is_none_or(|(_, slope)| line.slope > slope) {
                best = Some((pressed, line.slope));
            }
        }
        match best {
            Some((answers, _)) => TaxelState::CrossWired { answers },
            None if own.slope > floor => TaxelState::Ok,
            None => TaxelState::Dead,
        }
    }

    /// The standard error of a fitted slope, Pa/m; 0 with fewer than three points.
    fn slope_error(&self, taxel: usize, pressed: usize, line: &Line) -> f64 {
        let points = self.points(taxel, pressed);
        if points.len() < 3 {
            return 0.0;
        }
        let n = points.len() as f64;
        let mean = points.iter().map(|point| point.0).sum::<f64>() / n;
        let s_xx: f64 = points.iter().map(|point| (point.0 - mean).powi(2)).sum();
        let left = n * line.goodness(&points).residual.powi(2);
        (left / (n - 2.0) / s_xx).sqrt()
    }
}

/// The up to eight taxels around one.
fn neighbors(taxel: usize, grid: &TaxelGrid) -> impl Iterator<Item = usize> {
    let (row, col, cols) = (taxel / grid.cols, taxel % grid.cols, grid.cols);
    let rows = row.saturating_sub(1)..=(row + 1).min(grid.rows - 1);
    let near = move |row| (col.saturating_sub(1)..=(col + 1).min(cols - 1)).map(move |c| (row, c));
    rows.flat_map(near).map(move |(row, col)| row * cols + col).filter(move |near| *near != taxel)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::spread_fit::{Indenter, indentation_image};
    use crate::units::{KPA, MM};

    const GRID: TaxelGrid = TaxelGrid { rows: 3, cols: 3, pitch: 2.0 * MM, taxel_width: 1.8 * MM };

    /// Presses of every taxel to five depths. The pressed taxel reads `gain(taxel)` · depth,
    /// the others the share of it left by a blur of 1.36 pitches.
    fn presses(gain: impl Fn(usize) -> f64, wire: impl Fn(usize) -> usize) -> Vec<Indentation> {
        let mut presses = Vec::new();
        for taxel in 0..9 {
            let (x, y) = GRID.center(taxel / 3, taxel % 3);
            let indenter = Indenter { diameter: 1.0 * MM };
            let shape = indentation_image(&GRID, 1.36 * GRID.pitch, indenter, (x, y));
            for depth in [0.2, 0.3, 0.4, 0.5, 0.6] {
                let depth = depth * MM;
                let read = |reads: usize| {
                    let at = wire(reads);
                    Some(gain(reads) * depth * shape[at] / shape[taxel])
                };
                let pressures = (0..9).map(read).collect();
                presses.push(Indentation { taxel, depth, pressures });
            }
        }
        presses
    }

    #[test]
    fn gains_are_recovered_and_removed() {
        // Gains 8, 9, 10, …, 16 MPa/m: the pooled slope is their mean, 12 MPa/m.
        let gain = |taxel: usize| (8.0 + taxel as f64) * 1e6;
        let fit = fit_response(&presses(gain, |taxel| taxel), &GRID, 20.0 * KPA).unwrap();
        let calibration = &fit.calibration;
        assert!((calibration.target().slope / 12e6 - 1.0).abs() < 1e-9);
        for (taxel, response) in calibration.taxels().iter().enumerate() {
            assert_eq!(response.state, TaxelState::Ok);
            assert!((response.line.slope / gain(taxel) - 1.0).abs() < 1e-9);
            assert!((response.r_squared - 1.0).abs() < 1e-9);
        }
        assert!(fit.before.residual > 500.0, "{:?}", fit.before);
        assert!(fit.after.residual < 1e-6 && (fit.after.r_squared - 1.0).abs() < 1e-9);
    }

    #[test]
    fn dead_and_cross_wired_taxels_are_distinguished_under_blur() {
        let gain = |taxel: usize| if taxel == 2 { 1e4 } else { 1e7 };
        let wire = |taxel: usize| if taxel == 7 { 4 } else { taxel };
        let fit = fit_response(&presses(gain, wire), &GRID, 20.0 * KPA).unwrap();
        let states: Vec<TaxelState> =
            fit.calibration.taxels().iter().map(|taxel| taxel.state).collect();
        for (taxel, state) in states.into_iter().enumerate() {
            let expected = match taxel {
                2 => TaxelState::Dead,
                7 => TaxelState::CrossWired { answers: 4 },
                _ => TaxelState::Ok,
            };
            assert_eq!(state, expected, "taxel {taxel}");
        }
        assert!((fit.calibration.target().slope / 1e7 - 1.0).abs() < 1e-9, "left out of the fit");
    }

    #[test]
    fn saturated_values_are_left_out() {
        // 20 MPa/m reach 10 kPa at 0.5 mm: the values of 0.5 and 0.6 mm are clipped there.
        let mut presses = presses(|_| 2e7, |taxel| taxel);
        for press in &mut presses {
            press.pressures.iter_mut().flatten().for_each(|p| *p = p.min(10.0 * KPA));
        }
        let fit = fit_response(&presses, &GRID, 10.0 * KPA).unwrap();
        assert!((fit.calibration.target().slope / 2e7 - 1.0).abs() < 1e-9);
    }

    #[test]
    fn missing_presses_are_refused_by_taxel() {
        let all = presses(|_| 1e7, |taxel| taxel);
        let without: Vec<_> = all.iter().filter(|press| press.taxel != 5).cloned().collect();
        let fit = |presses: &[Indentation]| fit_response(presses, &GRID, 20.0 * KPA).unwrap_err();
        assert_eq!(fit(&without), ResponseError::Depths { row: 1, col: 2 });
        let mut wrong = all.clone();
        wrong[3].depth = f64::NAN;
        assert!(matches!(fit(&wrong), ResponseError::Depth { press: 3, .. }));
        wrong[2].pressures.pop();
        let shape = ResponseError::Shape { press: 2, found: 8, expected: 9 };
        assert_eq!(fit(&wrong), shape);
        wrong[1].taxel = 9;
        assert_eq!(fit(&wrong), ResponseError::Taxel { press: 1, taxel: 9, n_taxels: 9 });
        let numb = presses(|_| 0.0, |taxel| taxel);
        assert_eq!(fit(&numb), ResponseError::Silent { usable: 0, n_taxels: 9 });
    }
}
