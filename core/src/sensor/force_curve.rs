//! The force curve of a taxel: displacement of the covering to pressure.

use super::SensorError;

/// A piecewise-linear map from displacement (metres) to pressure (pascal).
#[derive(Clone, Debug, PartialEq)]
pub struct ForceCurve {
    knots: Vec<(f64, f64)>,
}

impl ForceCurve {
    /// A curve through `knots` of (displacement in metres, pressure in pascal).
    ///
    /// # Errors
    /// [`SensorError::ForceCurve`] unless there are 2 to 64 knots, the first is (0, 0), all
    /// are finite, displacements rise strictly and pressures do not fall.
    pub fn new(knots: Vec<(f64, f64)>) -> Result<Self, SensorError> {
        let starts_at_zero = knots.first() == Some(&(0.0, 0.0));
        if !(2..=64).contains(&knots.len()) || !starts_at_zero {
            return Err(SensorError::ForceCurve { knot: 0 });
        }
        let bad = knots.windows(2).position(|pair| {
            let ((d0, p0), (d1, p1)) = (pair[0], pair[1]);
            !(d1.is_finite() && p1.is_finite() && d1 > d0 && p1 >= p0)
        });
        match bad {
            Some(knot) => Err(SensorError::ForceCurve { knot: knot + 1 }),
            None => Ok(Self { knots }),
        }
    }

    /// The knots, as given.
    #[must_use]
    pub fn knots(&self) -> &[(f64, f64)] {
        &self.knots
    }

    /// The pressure (pascal) at a displacement (metres), extrapolated by the last segment; 0
    /// for a negative displacement.
    #[must_use]
    pub fn pressure(&self, displacement: f64) -> f64 {
        if displacement <= 0.0 {
            return 0.0;
        }
        let n = self.knots.len();
        let above = self.knots.partition_point(|knot| knot.0 < displacement).clamp(1, n - 1);
        let ((d0, p0), (d1, p1)) = (self.knots[above - 1], self.knots[above]);
        p0 + (p1 - p0) * (displacement - d0) / (d1 - d0)
    }

    /// The displacement (metres) that gives `pressure` (pascal), the inverse of
    /// [`ForceCurve::pressure`]; on a flat segment its start.
    #[must_use]
    pub fn displacement(&self, pressure: f64) -> f64 {
        if pressure <= 0.0 {
            return 0.0;
        }
        let n = self.knots.len();
        let above = self.knots.partition_point(|knot| knot.1 < pressure).clamp(1, n - 1);
        let ((d0, p0), (d1, p1)) = (self.knots[above - 1], self.knots[above]);
        if p1 <= p0 { d0 } else { d0 + (d1 - d0) * (pressure - p0) / (p1 - p0) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::{KPA, MM};

    #[test]
    fn the_force_curve_and_its_inverse_agree() {
        // Knots at 1 mm → 4 kPa and 2 mm → 12 kPa: 1.5 mm gives 8 kPa.
        let curve =
            ForceCurve::new(vec![(0.0, 0.0), (1.0 * MM, 4.0 * KPA), (2.0 * MM, 12.0 * KPA)])
                .unwrap();
        assert!((curve.pressure(1.5 * MM) - 8.0 * KPA).abs() < 1e-9);
        assert!((curve.displacement(8.0 * KPA) - 1.5 * MM).abs() < 1e-12);
        assert!((curve.pressure(3.0 * MM) - 20.0 * KPA).abs() < 1e-9);
        assert!(curve.pressure(-MM).abs() < 1e-12);
    }

    #[test]
    fn a_falling_force_curve_is_refused() {
        let knots = vec![(0.0, 0.0), (1.0 * MM, 5.0), (2.0 * MM, 4.0)];
        assert_eq!(ForceCurve::new(knots), Err(SensorError::ForceCurve { knot: 2 }));
    }
}
