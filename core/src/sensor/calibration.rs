//! Calibration: maps the uneven responses of a sensor's taxels to one common response.
//!
//! Source: section 2.2, equation 2.1 with an offset for every taxel (`docs/equations.md`), or the
//! same with curves instead of lines. Pressures in pascal, row-major in the sensor frame's order.
//! Not here: fitting it to indentations (`response`).

use thiserror::Error;

use super::line::Line;
use super::response_curve::ResponseCurves;

/// State of a taxel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TaxelState {
    /// It responds to presses on it.
    Ok,
    /// It never responds.
    Dead,
    /// It responds more to presses on another taxel than to presses on it.
    CrossWired {
        /// The taxel to whose presses it responds.
        answers: usize,
    },
}

/// Response of one taxel to its own indentation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TaxelResponse {
    /// Pressure (Pa) over depth (m): res(d) = slope · d + offset.
    pub line: Line,
    /// Fraction of the response's variance that the line explains.
    pub r_squared: f64,
    /// State of the taxel.
    pub state: TaxelState,
}

/// A checked correction of row-major images; applying it cannot fail.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibration {
    target: Line,
    taxels: Vec<TaxelResponse>,
    curves: Option<ResponseCurves>,
}

/// Error of numbers that are not a calibration.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum CalibrationError {
    /// The target line does not rise with depth.
    #[error("the target line has slope {slope} Pa/m, expected a finite number above 0")]
    Target {
        /// The target's slope.
        slope: f64,
    },
    /// The response of a usable taxel does not rise with depth.
    #[error("taxel {taxel} has slope {slope} Pa/m, expected a finite number above 0")]
    Taxel {
        /// Its row-major index.
        taxel: usize,
        /// The response's slope.
        slope: f64,
    },
    /// A cross-wired taxel names one that does not exist.
    #[error("taxel {taxel} answers taxel {answers}, expected below {n_taxels}")]
    Answers {
        /// Its row-major index.
        taxel: usize,
        /// The named index.
        answers: usize,
        /// Number of taxels.
        n_taxels: usize,
    },
    /// A usable taxel has no curve, or there are curves for more taxels than exist.
    #[error("taxel {taxel} has no response curve, expected one for every usable taxel alone")]
    Curve {
        /// Its row-major index.
        taxel: usize,
    },
}

impl Calibration {
    /// A calibration to the line `target` of `taxels` in row-major order.
    ///
    /// # Errors
    /// [`CalibrationError`] unless the target and every usable taxel rise with depth.
    pub fn new(target: Line, taxels: Vec<TaxelResponse>) -> Result<Self, CalibrationError> {
        let rises = |line: &Line| line.slope > 0.0 && line.slope.is_finite();
        let n_taxels = taxels.len();
        if !rises(&target) || !target.offset.is_finite() {
            return Err(CalibrationError::Target { slope: target.slope });
        }
        for (taxel, response) in taxels.iter().enumerate() {
            let line = &response.line;
            match response.state {
                TaxelState::Ok if !rises(line) || !line.offset.is_finite() => {
                    return Err(CalibrationError::Taxel { taxel, slope: line.slope });
                }
                TaxelState::CrossWired { answers } if answers >= n_taxels => {
                    return Err(CalibrationError::Answers { taxel, answers, n_taxels });
                }
                TaxelState::Ok | TaxelState::Dead | TaxelState::CrossWired { .. } => {}
            }
        }
        Ok(Self { target, taxels, curves: None })
    }

    /// The same calibration with curves in place of the lines.
    ///
    /// # Errors
    /// [`CalibrationError::Curve`] unless the usable taxels, and no others, have a curve.
    pub fn with_curves(self, curves: ResponseCurves) -> Result<Self, CalibrationError> {
        let n_taxels = self.taxels.len().max(curves.taxels.len());
        let is_right = |taxel: &usize| {
            let curve = curves.taxels.get(*taxel);
            *taxel < self.taxels.len()
                && curve.is_some_and(|curve| curve.is_some() == self.is_usable(*taxel))
        };
        match (0..n_taxels).find(|taxel| !is_right(taxel)) {
            Some(taxel) => Err(CalibrationError::Curve { taxel }),
            None => Ok(Self { curves: Some(curves), ..self }),
        }
    }

    /// The common response line after the correction.
    #[must_use]
    pub fn target(&self) -> Line {
        self.target
    }

    /// The curves that apply in place of the lines, if any.
    #[must_use]
    pub fn curves(&self) -> Option<&ResponseCurves> {
        self.curves.as_ref()
    }

    /// The taxels in row-major order.
    #[must_use]
    pub fn taxels(&self) -> &[TaxelResponse] {
        &self.taxels
    }

    /// Whether a taxel's values are used.
    #[must_use]
    pub fn is_usable(&self, taxel: usize) -> bool {
        self.taxels[taxel].state == TaxelState::Ok
    }

    /// The corrected pressure (Pa) of a usable taxel: the common response at the depth at which
    /// the taxel responds so. With lines that is equation 2.1, adj(res) = b + a · (res − bᵢ) / aᵢ.
    #[must_use]
    pub fn corrected(&self, taxel: usize, pressure: f64) -> f64 {
        if let Some(curves) = &self.curves
            && let Some(own) = &curves.taxels[taxel]
        {
            return curves.target.at(own.depth(pressure));
        }
        let own = &self.taxels[taxel].line;
        self.target.offset + self.target.slope * (pressure - own.offset) / own.slope
    }

    /// A corrected pressure (Pa) in proportion to the covering's displacement: above the pressure
    /// at rest, and straightened if the response is a curve.
    #[must_use]
    pub fn straightened(&self, corrected: f64) -> f64 {
        match &self.curves {
            Some(curves) => self.target.slope * curves.target.depth(corrected),
            None => corrected - self.target.offset,
        }
    }

    /// Corrects a row-major image (Pa) in place; unusable taxels lose their value.
    pub fn correct(&self, pressures: &mut [Option<f64>]) {
        for (taxel, pressure) in pressures.iter_mut().enumerate() {
            *pressure = pressure
                .filter(|_| self.is_usable(taxel))
                .map(|pressure| self.corrected(taxel, pressure));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::response_curve::ResponseCurve;

    fn taxel(slope: f64, offset: f64, state: TaxelState) -> TaxelResponse {
        TaxelResponse { line: Line { slope, offset }, r_squared: 1.0, state }
    }

    #[test]
    fn readings_are_mapped_to_the_target_line() {
        // Target 10 d + 1; the taxel gives 20 d + 3: at d = 2 it reads 43, the target 21.
        let target = Line { slope: 10.0, offset: 1.0 };
        let taxels = vec![
            taxel(20.0, 3.0, TaxelState::Ok),
            taxel(0.0, 0.0, TaxelState::Dead),
            taxel(5.0, 0.0, TaxelState::CrossWired { answers: 0 }),
            taxel(10.0, 1.0, TaxelState::Ok),
        ];
        let calibration = Calibration::new(target, taxels).unwrap();
        let mut image = [Some(43.0), Some(5.0), Some(5.0), None];
        calibration.correct(&mut image);
        assert_eq!(image[1..], [None, None, None]);
        assert!((image[0].unwrap() - 21.0).abs() < 1e-12);
    }

    #[test]
    fn curves_apply_in_place_of_lines() {
        // The taxel gives 4 at depth 1 and 16 at depth 2; the target 1 and 10.
        let curve = |knots: &[(f64, f64)]| ResponseCurve::new(knots.to_vec()).unwrap();
        let own = Some(curve(&[(0.0, 0.0), (1.0, 4.0), (2.0, 16.0)]));
        let target = curve(&[(0.0, 0.0), (1.0, 1.0), (2.0, 10.0)]);
        let line = Line { slope: 5.0, offset: 0.0 };
        let taxels = vec![taxel(8.0, 0.0, TaxelState::Ok), taxel(0.0, 0.0, TaxelState::Dead)];
        let lines = Calibration::new(line, taxels).unwrap();
        let curves = |taxels| ResponseCurves { target: target.clone(), taxels };
        let calibration = lines.clone().with_curves(curves(vec![own.clone(), None])).unwrap();
        assert!((calibration.corrected(0, 10.0) - 5.5).abs() < 1e-12);
        assert!((calibration.straightened(5.5) - 7.5).abs() < 1e-12, "depth 1.5");
        for wrong in [vec![None, None], vec![own.clone()], vec![own.clone(), own.clone()]] {
            let refused = lines.clone().with_curves(curves(wrong.clone()));
            assert!(matches!(refused, Err(CalibrationError::Curve { .. })), "{wrong:?}");
        }
    }

    #[test]
    fn responses_that_do_not_rise_are_refused() {
        let target = Line { slope: 10.0, offset: 0.0 };
        let falling = vec![taxel(1.0, 0.0, TaxelState::Ok), taxel(-1.0, 0.0, TaxelState::Ok)];
        let error = Calibration::new(target, falling).unwrap_err();
        assert_eq!(error, CalibrationError::Taxel { taxel: 1, slope: -1.0 });
        let flat = Calibration::new(Line { slope: 0.0, offset: 0.0 }, Vec::new());
        assert_eq!(flat, Err(CalibrationError::Target { slope: 0.0 }));
        let stray = vec![taxel(1.0, 0.0, TaxelState::CrossWired { answers: 7 })];
        let error = Calibration::new(target, stray).unwrap_err();
        assert_eq!(error, CalibrationError::Answers { taxel: 0, answers: 7, n_taxels: 1 });
    }
}
