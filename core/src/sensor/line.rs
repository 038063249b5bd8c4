//! Straight lines through measured points: the least-squares fit and its quality.

/// y = slope · x + offset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Rise of y per unit of x.
    pub slope: f64,
    /// y at x = 0.
    pub offset: f64,
}

/// Goodness of a fit to points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Goodness {
    /// 1 − residual over total sum of squares; 1 when the points do not vary at all.
    pub r_squared: f64,
    /// Root mean square of the residuals, in the unit of y.
    pub residual: f64,
}

impl Line {
    /// The line of least squares through points (x, y); `None` unless there are two different
    /// x.
    #[must_use]
    pub fn fit(points: &[(f64, f64)]) -> Option<Self> {
        let n = points.len() as f64;
        let mean_x = points.iter().map(|point| point.0).sum::<f64>() / n;
        let mean_y = points.iter().map(|point| point.1).sum::<f64>() / n;
        let s_xx: f64 = points.iter().map(|point| (point.0 - mean_x).powi(2)).sum();
        let s_xy: f64 = points.iter().map(|point| (point.0 - mean_x) * (point.1 - mean_y)).sum();
        let first = points.first()?.0;
        let varies = points.iter().any(|point| (point.0 - first).abs() > 1e-9 * first.abs());
        let slope = s_xy / s_xx;
        (varies && slope.is_finite()).then_some(Self { slope, offset: mean_y - slope * mean_x })
    }

    /// The line's y at `x`.
    #[must_use]
    pub fn at(&self, x: f64) -> f64 {
        self.slope * x + self.offset
    }

    /// The goodness of fit of this line to any points.
    #[must_use]
    pub fn goodness(&self, points: &[(f64, f64)]) -> Goodness {
        Goodness::of(points, |x| self.at(x))
    }
}

impl Goodness {
    /// The goodness of `at`, y over x, at points (x, y).
    #[must_use]
    pub fn of(points: &[(f64, f64)], at: impl Fn(f64) -> f64) -> Self {
        let n = points.len().max(1) as f64;
        let mean_y = points.iter().map(|point| point.1).sum::<f64>() / n;
        let total: f64 = points.iter().map(|point| (point.1 - mean_y).powi(2)).sum();
        let left: f64 = points.iter().map(|point| (point.1 - at(point.0)).powi(2)).sum();
        let r_squared = if total > 0.0 { 1.0 - left / total } else { 1.0 };
        Self { r_squared, residual: (left / n).sqrt() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fit_to_three_points_matches_hand_computed_values() {
        // Means 2 and 3; s_xx = 2, s_xy = (−1)(−1) + 0 + (1)(2) = 3; slope 1.5, offset 0.
        // Residuals 0.5, −1, 0.5: left 1.5 of total 1 + 1 + 4 = 6.
        let points = [(1.0, 2.0), (2.0, 2.0), (3.0, 5.0)];
        let line = Line::fit(&points).unwrap();
        assert!((line.slope - 1.5).abs() < 1e-12 && line.offset.abs() < 1e-12, "{line:?}");
        let goodness = line.goodness(&points);
        assert!((goodness.r_squared - 0.75).abs() < 1e-12);
        assert!((goodness.residual - 0.5f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn vertical_points_have_no_line() {
        assert_eq!(Line::fit(&[(1.0, 2.0), (1.0, 3.0)]), None);
        assert_eq!(Line::fit(&[(1.0, 2.0)]), None);
        assert_eq!(Line::fit(&[]), None);
    }
}
