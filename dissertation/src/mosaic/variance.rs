//! Variance of single taxels' residuals as a function of pressure.
//!
//! A constant (noise, quantisation) and a share of the pressure (drift, gains, slips on
//! slopes), fitted to residuals of which some are of stuck taxels.

/// The variance of a residual: `constant` (Pa²) and `share` of the squared pressure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Variance {
    pub(super) constant: f64,
    pub(super) share: f64,
}

/// Variances beyond which a squared residual is an outlier.
const OUTLIER: f64 = 12.0;

/// Smallest share: 5 % of the pressure.
const SHARE_MIN: f64 = 0.0025;

/// The median of a squared normal variable.
const MEDIAN_SQUARE: f64 = 0.455;

impl Variance {
    /// Fits pairs of squared expected pressure and squared residual (Pa²); the constant is at
    /// least `floor`.
    ///
    /// Starts at the medians of the weakly and the strongly pressed halves; then weighted
    /// least squares without outliers, with the weights of the fit before.
    pub(super) fn of(squares: &[(f64, f64)], floor: f64) -> Self {
        let mut sorted: Vec<(f64, f64)> = squares.to_vec();
        sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (weak, strong) = sorted.split_at(sorted.len() / 2);
        let constant = (median(weak) / MEDIAN_SQUARE).max(floor);
        let pressure = strong.iter().map(|pair| pair.0).sum::<f64>() / strong.len().max(1) as f64;
        let excess = (median(strong) / MEDIAN_SQUARE - constant).max(0.0);
        let share = if pressure > 0.0 { excess / pressure } else { 0.0 };
        let share = share.max(SHARE_MIN);
        let mut found = Self { constant, share };
        for _round in 0..4 {
            found = found.improved(squares, floor);
        }
        found
    }

    /// The variance at a squared pressure, Pa².
    pub(super) fn at(&self, squared_pressure: f64) -> f64 {
        self.constant + self.share * squared_pressure
    }

    fn improved(self, squares: &[(f64, f64)], floor: f64) -> Self {
        // Σ w, Σ w x, Σ w x², Σ w y, Σ w x y.
        let mut sums = [0.0; 5];
        for (x, y) in squares {
            let expected = self.at(*x);
            if *y <= OUTLIER * expected {
                let w = expected.powi(-2);
                for (sum, term) in sums.iter_mut().zip([1.0, *x, x * x, *y, x * y]) {
                    *sum += w * term;
                }
            }
        }
        let [w, wx, wxx, wy, wxy] = sums;
        let determinant = w * wxx - wx * wx;
        if determinant <= 1e-9 * w * wxx || w <= 0.0 {
            return self;
        }
        let constant = ((wxx * wy - wx * wxy) / determinant).max(floor);
        Self { constant, share: ((wxy - constant * wx) / wxx).max(SHARE_MIN) }
    }
}

fn median(squares: &[(f64, f64)]) -> f64 {
    let mut residuals: Vec<f64> = squares.iter().map(|pair| pair.1).collect();
    if residuals.is_empty() {
        return 0.0;
    }
    let middle = residuals.len() / 2;
    *residuals.select_nth_unstable_by(middle, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fit_separates_constant_and_share_without_stuck_taxels() {
        // Residuals of ±√(400 + 0.01 p²) at 0 to 4 kPa, and one taxel in a hundred stuck.
        let pair = |index: u32| {
            let squared = (f64::from(index % 5) * 1_000.0).powi(2);
            (squared, if index % 100 == 7 { 4e8 } else { 400.0 + 0.01 * squared })
        };
        let squares: Vec<(f64, f64)> = (0..1_000).map(pair).collect();
        let found = Variance::of(&squares, 1.0);
        assert!((found.constant / 400.0 - 1.0).abs() < 0.01, "{found:?}");
        assert!((found.share / 0.01 - 1.0).abs() < 0.01, "{found:?}");
    }

    #[test]
    fn without_residuals_the_variance_is_the_floor() {
        assert_eq!(Variance::of(&[], 9.0), Variance { constant: 9.0, share: SHARE_MIN });
    }
}
