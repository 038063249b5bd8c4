//! Calibration: maps the uneven responses of a sensor's taxels to one common response.
//!
//! Source: section 2.2, equation 2.1 with an offset for every taxel (`docs/equations.md`).
//! Pressures in pascal, row-major in the sensor frame's order. Not here: fitting it to
//! indentations (`response`).

use thiserror::Error;

use super::line::Line;

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
        Ok(Self { target, taxels })
    }

    /// The common response line after the correction.
    #[must_use]
    pub fn target(&self) -> Line {
        self.target
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

    /// The corrected pressure (Pa) of a usable taxel. Equation 2.1:
    /// adj(res) = b + a · (res − bᵢ) / aᵢ.
    #[must_use]
    pub fn corrected(&self, taxel: usize, pressure: f64) -> f64 {
        let own = &self.taxels[taxel].line;
        self.target.offset + self.target.slope * (pressure - own.offset) / own.slope
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
