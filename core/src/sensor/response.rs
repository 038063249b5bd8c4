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
use super::response_curve::{ResponseCurve, ResponseCurves};

/// Fraction of the median slope below which a taxel is dead.
const DEAD_SHARE: f64 = 0.2;
/// Relative margin by which the response to another taxel's presses must be larger, besides
/// [`CROSS_DEVIATIONS`] standard errors.
const CROSS_MARGIN: f64 = 0.05;
/// Margin in standard errors of the difference of two slopes.
const CROSS_DEVIATIONS: f64 = 3.0;
/// Parts of the depths that are left out in turn to judge curves. Chosen: five depths are usual, so
/// that each is left out once.
const DEPTH_FOLDS: usize = 5;

/// Form of the responses that are fitted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ResponseForm {
    /// Lines: equation 2.1.
    #[default]
    Lines,
    /// Rising curves, which also show the force curve of the sensor.
    Curves,
}

/// Points (depth, pressure).
type Points = Vec<(f64, f64)>;

/// One press at the centre of a taxel.
#[derive(Clone, Debug, PartialEq)]
pub struct Indentation {
    /// Row-major index of the pressed taxel.
    pub taxel: usize,
    /// Depth, metres; 0 for a reading at rest.
    pub depth: f64,
    /// The image, Pa, row-major; `None` for a taxel without a value.
    pub pressures: Vec<Option<f64>>,
}

/// A calibration and the quality of its fit.
#[derive(Clone, Debug, PartialEq)]
pub struct ResponseFit {
    /// The calibration.
    pub calibration: Calibration,
    /// Responses of the usable taxels as measured, against the target.
    pub before: Goodness,
    /// The same responses after the correction; with curves, each press corrected by curves that do
    /// not know its depth.
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
    #[error("press {press} is {depth} m deep, expected a finite number from 0")]
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
    /// A usable taxel has no rising curve.
    #[error(
        "the response of the taxel in row {row}, column {col} does not rise from depth to depth: \
         press it deeper, or fit lines"
    )]
    Curve {
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
    /// Most pressed taxels are saturated.
    #[error(
        "the pressed taxel is saturated in {n_saturated} of {n_presses} presses: press less deep, or \
         are the values in another unit than pascal?"
    )]
    Saturated {
        /// Number of presses that saturate the pressed taxel.
        n_saturated: usize,
        /// Number of presses.
        n_presses: usize,
    },
    /// Most pressed taxels read less than nothing.
    #[error(
        "the pressed taxel is below zero in {n_negative} of {n_presses} presses: is the sign right, \
         and was the sensor tared?"
    )]
    Negative {
        /// Number of presses in which the pressed taxel is below zero.
        n_negative: usize,
        /// Number of presses.
        n_presses: usize,
    },
    /// The fitted responses do not rise.
    #[error(transparent)]
    Fit(#[from] CalibrationError),
}

/// Fits a calibration. Values at or above `saturation` (Pa) are left out. Curves need depths that
/// differ as lines do; from two depths they are lines between these.
///
/// # Errors
/// [`ResponseError`] names the first invalid press or taxel.
pub fn fit_response(
    presses: &[Indentation],
    grid: &TaxelGrid,
    saturation: f64,
    form: ResponseForm,
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
        return Err(silence(presses, saturation, usable.len(), taxels.len()));
    }
    let pooled: Vec<(f64, f64)> =
        usable.iter().flat_map(|taxel| measured.points(*taxel, *taxel)).collect();
    let target = Line::fit(&pooled).ok_or(CalibrationError::Target { slope: 0.0 })?;
    let mut calibration = Calibration::new(target, taxels)?;
    if form == ResponseForm::Curves {
        calibration = calibration.with_curves(measured.curves(&usable, grid)?)?;
    }
    let corrected = measured.corrected(&usable, &calibration);
    let goodness = |points: &[(f64, f64)]| match calibration.curves() {
        Some(curves) => curves.target.goodness(points),
        None => target.goodness(points),
    };
    let (before, after) = (goodness(&pooled), goodness(&corrected));
    Ok(ResponseFit { calibration, before, after })
}

/// Why most taxels do not answer their own presses.
fn silence(
    presses: &[Indentation],
    saturation: f64,
    usable: usize,
    n_taxels: usize,
) -> ResponseError {
    let n_presses = presses.len();
    let count = |is: &dyn Fn(f64) -> bool| {
        presses.iter().filter(|press| press.pressures[press.taxel].is_some_and(is)).count()
    };
    let (n_saturated, n_negative) = (count(&|p| p >= saturation), count(&|p| p < 0.0));
    if 2 * n_saturated > n_presses {
        return ResponseError::Saturated { n_saturated, n_presses };
    }
    if 2 * n_negative > n_presses {
        return ResponseError::Negative { n_negative, n_presses };
    }
    ResponseError::Silent { usable, n_taxels }
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
        if !(depth.is_finite() && depth >= 0.0) {
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

    /// Depths and corrected pressures of the usable taxels' own presses. A curve meets a press that
    /// is alone at its depth, so that curves are judged at depths that they were not fitted to:
    /// one fold of the depths after the other is corrected by the curves of the others.
    fn corrected(&self, usable: &[usize], calibration: &Calibration) -> Vec<(f64, f64)> {
        let own: Vec<(usize, Vec<(f64, f64)>)> =
            usable.iter().map(|&taxel| (taxel, self.points(taxel, taxel))).collect();
        let in_full = |taxel: usize, p: f64| calibration.corrected(taxel, p);
        if calibration.curves().is_none() {
            let each = own.iter().flat_map(|(taxel, points)| {
                points.iter().map(|&(depth, p)| (depth, in_full(*taxel, p)))
            });
            return each.collect();
        }
        let mut depths: Vec<f64> = own.iter().flat_map(|own| own.1.iter().map(|p| p.0)).collect();
        depths.sort_by(f64::total_cmp);
        depths.dedup();
        let fold_of = |depth: f64| depths.partition_point(|other| *other < depth) % DEPTH_FOLDS;
        let mut corrected = Vec::new();
        for fold in 0..DEPTH_FOLDS {
            let parts: Vec<(usize, Points, Points)> = own
                .iter()
                .map(|(taxel, points)| {
                    let (left_out, others) =
                        points.iter().partition(|point| fold_of(point.0) == fold);
                    (*taxel, left_out, others)
                })
                .collect();
            let pooled: Points = parts.iter().flat_map(|part| part.2.iter().copied()).collect();
            let target = ResponseCurve::fit(&pooled);
            for (taxel, left_out, others) in parts {
                let own = ResponseCurve::fit(&others);
                corrected.extend(left_out.iter().map(|&(depth, p)| {
                    let by_others = target.as_ref().zip(own.as_ref());
                    let by_others = by_others.map(|(target, own)| target.at(own.depth(p)));
                    (depth, by_others.unwrap_or_else(|| in_full(taxel, p)))
                }));
            }
        }
        corrected
    }

    /// The curves of the usable taxels, and the one of all their points.
    fn curves(&self, usable: &[usize], grid: &TaxelGrid) -> Result<ResponseCurves, ResponseError> {
        let mut taxels = vec![None; grid.n_taxels()];
        let mut pooled = Vec::new();
        let refused =
            |taxel: usize| ResponseError::Curve { row: taxel / grid.cols, col: taxel % grid.cols };
        for &taxel in usable {
            let points = self.points(taxel, taxel);
            taxels[taxel] = Some(ResponseCurve::fit(&points).ok_or_else(|| refused(taxel))?);
            pooled.extend(points);
        }
        let first = usable.first().copied().unwrap_or(0);
        let target = ResponseCurve::fit(&pooled).ok_or_else(|| refused(first))?;
        Ok(ResponseCurves { target, taxels })
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
mod tests;
