//! Response curves: pressure over depth of indentation, rising but not straight.
//!
//! Section 2.5.1 takes the force curve from the calibration and does not say how. Here: mean
//! pressures at the pressed depths, made to rise by pooling neighbours that do not (isotonic
//! regression), joined by straight lines. The first and the last line go on beyond the ends.
//! Depths in metres, pressures in pascal. Not here: straight responses (`line`), and the force
//! curve of a description, which starts at no pressure (`force_curve`).

use thiserror::Error;

use super::force_curve::ForceCurve;
use super::line::Goodness;

/// Largest number of knots of a fitted curve. Chosen: twice the depths that the dissertation
/// pressed to, so that a curve of five depths is never cut and one of random depths is smooth.
const FITTED_KNOTS_MAX: usize = 10;

/// A rising response through knots.
#[derive(Clone, Debug, PartialEq)]
pub struct ResponseCurve {
    knots: Vec<(f64, f64)>,
}

/// The response curves of a sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct ResponseCurves {
    /// The common curve to which usable taxels are corrected.
    pub target: ResponseCurve,
    /// The taxels' own, row-major; `None` for taxels that are not used.
    pub taxels: Vec<Option<ResponseCurve>>,
}

/// Error of knots that are no response.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[error(
    "knot {knot} of the response does not rise, expected depths and pressures above those before"
)]
pub struct ResponseCurveError {
    /// The first such knot; 0 if there are fewer than two.
    pub knot: usize,
}

impl ResponseCurve {
    /// A curve through knots of (depth, pressure).
    ///
    /// # Errors
    /// [`ResponseCurveError`] unless there are at least two, finite, each above the one before.
    pub fn new(knots: Vec<(f64, f64)>) -> Result<Self, ResponseCurveError> {
        if knots.len() < 2 {
            return Err(ResponseCurveError { knot: 0 });
        }
        let rises = |pair: &[(f64, f64)]| {
            let (depth, pressure) = (pair[1].0 - pair[0].0, pair[1].1 - pair[0].1);
            depth > 0.0 && depth.is_finite() && pressure > 0.0 && pressure.is_finite()
        };
        match knots.windows(2).position(|pair| !rises(pair)) {
            Some(knot) => Err(ResponseCurveError { knot: knot + 1 }),
            None => Ok(Self { knots }),
        }
    }

    /// The curve of least squares through points (depth, pressure) among those that rise from
    /// depth to depth; `None` if fewer than two of its knots rise.
    #[must_use]
    pub fn fit(points: &[(f64, f64)]) -> Option<Self> {
        let mut pooled: Vec<Pool> = Vec::new();
        for pool in pools_by_depth(points) {
            pooled.push(pool);
            while let [.., below, above] = pooled[..]
                && above.pressure() <= below.pressure()
            {
                pooled.truncate(pooled.len() - 2);
                pooled.push(below.with(above));
            }
        }
        Self::new(pooled.iter().map(|pool| (pool.depth(), pool.pressure())).collect()).ok()
    }

    /// The knots (depth, pressure), rising.
    #[must_use]
    pub fn knots(&self) -> &[(f64, f64)] {
        &self.knots
    }

    /// The pressure at a depth.
    #[must_use]
    pub fn at(&self, depth: f64) -> f64 {
        let ((d0, p0), (d1, p1)) = self.piece(|knot| knot.0 < depth);
        p0 + (p1 - p0) * (depth - d0) / (d1 - d0)
    }

    /// The depth that gives a pressure, the inverse of [`ResponseCurve::at`].
    #[must_use]
    pub fn depth(&self, pressure: f64) -> f64 {
        let ((d0, p0), (d1, p1)) = self.piece(|knot| knot.1 < pressure);
        d0 + (d1 - d0) * (pressure - p0) / (p1 - p0)
    }

    /// The goodness of this curve at any points (depth, pressure).
    #[must_use]
    pub fn goodness(&self, points: &[(f64, f64)]) -> Goodness {
        Goodness::of(points, |depth| self.at(depth))
    }

    /// The force curve of a sensor with this response: its pressures above that at no depth, over
    /// displacements in proportion to depth. A small indenter moves the covering less than a plate
    /// does, so that only the shape is measured: the scale is that of `described`, which the result
    /// meets at the deepest knot.
    ///
    /// `None` if the response does not rise above its pressure at no depth.
    #[must_use]
    pub fn force_curve(&self, described: &ForceCurve) -> Option<ForceCurve> {
        let rest = self.at(0.0);
        let (deepest, pressure) = *self.knots.last()?;
        let displacement_per_depth = described.displacement(pressure - rest) / deepest;
        let knots = self.knots.iter().filter(|knot| knot.0 > 0.0 && knot.1 > rest);
        let scaled = knots.map(|(depth, p)| (depth * displacement_per_depth, p - rest));
        ForceCurve::new(std::iter::once((0.0, 0.0)).chain(scaled).collect()).ok()
    }

    /// The ends of the piece with the first knot that is not `below`.
    fn piece(&self, below: impl Fn(&(f64, f64)) -> bool) -> ((f64, f64), (f64, f64)) {
        let above = self.knots.partition_point(below).clamp(1, self.knots.len() - 1);
        (self.knots[above - 1], self.knots[above])
    }
}

/// Sums of some points.
#[derive(Clone, Copy)]
struct Pool {
    n: f64,
    depths: f64,
    pressures: f64,
}

impl Pool {
    fn of(points: &[(f64, f64)]) -> Self {
        let depths = points.iter().map(|point| point.0).sum();
        let pressures = points.iter().map(|point| point.1).sum();
        Self { n: points.len() as f64, depths, pressures }
    }

    fn with(self, other: Self) -> Self {
        Self {
            n: self.n + other.n,
            depths: self.depths + other.depths,
            pressures: self.pressures + other.pressures,
        }
    }

    fn depth(&self) -> f64 {
        self.depths / self.n
    }

    fn pressure(&self) -> f64 {
        self.pressures / self.n
    }
}

/// The points of each depth, by depth; of more than [`FITTED_KNOTS_MAX`] depths as many runs of
/// neighbours.
fn pools_by_depth(points: &[(f64, f64)]) -> Vec<Pool> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    // Depths that differ by less are one depth, as in `Line::fit`.
    let is_same = |a: &(f64, f64), b: &(f64, f64)| (b.0 - a.0).abs() <= 1e-9 * b.0.abs();
    let by_depth: Vec<&[(f64, f64)]> = sorted.chunk_by(is_same).collect();
    let n_runs = by_depth.len().min(FITTED_KNOTS_MAX);
    let run = |index: usize| {
        let of = |run: usize| run * by_depth.len() / n_runs;
        Pool::of(&by_depth[of(index)..of(index + 1)].concat())
    };
    (0..n_runs).map(run).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::{KPA, MM};

    #[test]
    fn a_curve_passes_through_means_and_goes_on_straight() {
        let points = [(1.0, 1.0), (1.0, 3.0), (2.0, 6.0), (4.0, 8.0)];
        let curve = ResponseCurve::fit(&points).unwrap();
        assert_eq!(curve.knots(), [(1.0, 2.0), (2.0, 6.0), (4.0, 8.0)]);
        for (depth, pressure) in [(0.0, -2.0), (1.5, 4.0), (3.0, 7.0), (6.0, 10.0)] {
            assert!((curve.at(depth) - pressure).abs() < 1e-12);
            assert!((curve.depth(pressure) - depth).abs() < 1e-12);
        }
    }

    #[test]
    fn neighbours_that_fall_are_pooled() {
        // 5 then 3 pool to 4 at depth 2.5.
        let points = [(1.0, 1.0), (2.0, 5.0), (3.0, 3.0), (4.0, 9.0)];
        let curve = ResponseCurve::fit(&points).unwrap();
        assert_eq!(curve.knots(), [(1.0, 1.0), (2.5, 4.0), (4.0, 9.0)]);
        assert_eq!(ResponseCurve::fit(&[(1.0, 3.0), (2.0, 2.0)]), None);
        assert_eq!(ResponseCurve::fit(&[]), None);
    }

    #[test]
    fn many_depths_make_few_knots() {
        let points: Vec<(f64, f64)> = (1..=95).map(|i| (f64::from(i), f64::from(i))).collect();
        let curve = ResponseCurve::fit(&points).unwrap();
        assert_eq!(curve.knots().len(), FITTED_KNOTS_MAX);
        assert!((curve.at(50.0) - 50.0).abs() < 1e-9);
    }

    #[test]
    fn the_force_curve_has_the_measured_shape_and_described_scale() {
        // At rest 100 Pa; 1 kPa at 0.2 mm and 6 kPa at 0.6 mm above that. The description has
        // 6 kPa at 1.2 mm: displacements are twice the depths.
        let at = |depth: f64, pressure: f64| (depth * MM, 100.0 + pressure * KPA);
        let curve = ResponseCurve::new(vec![at(0.0, 0.0), at(0.2, 1.0), at(0.6, 6.0)]).unwrap();
        let described = ForceCurve::new(vec![(0.0, 0.0), (2.0 * MM, 10.0 * KPA)]).unwrap();
        let found = curve.force_curve(&described).unwrap();
        let expected = [(0.0, 0.0), (0.4 * MM, 1.0 * KPA), (1.2 * MM, 6.0 * KPA)];
        for (found, expected) in found.knots().iter().zip(expected) {
            assert!((found.0 - expected.0).abs() < 1e-12 && (found.1 - expected.1).abs() < 1e-9);
        }
        assert_eq!(found.knots().len(), 3);
    }

    #[test]
    fn knots_that_do_not_rise_are_refused_by_number() {
        let refused = |knots| ResponseCurve::new(knots).unwrap_err().knot;
        assert_eq!(refused(vec![(0.0, 0.0)]), 0);
        assert_eq!(refused(vec![(0.0, 0.0), (1.0, 1.0), (2.0, 1.0)]), 2);
        assert_eq!(refused(vec![(0.0, f64::NAN), (1.0, 1.0)]), 1);
    }
}
