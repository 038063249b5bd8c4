//! The linear-elastic reference of a covering: the response at the bottom to a point load on top.
//!
//! Source: section 2.3.1. Cubic 8-node elements of unit size, the bottom bonded to the
//! sensor, sides and top free, a vertical point load at the top's centre; the result is the
//! vertical force of every bottom node. The load is symmetric about both planes through it,
//! so a quarter is computed. Small deformations only. Lengths in elements, the load is 1.
//! Poisson's ratio is an argument; the pressure in a nearly incompressible solid would lock
//! plain elements, so the volumetric part is averaged over each element (`hexahedron`).

pub mod covering;
mod hexahedron;
mod solve;

use palpate_core::sensor::spread_fit::{cosine, golden_maximum, pearson};
use thiserror::Error;

pub use solve::SolveError;
use solve::{Quarter, solve};

/// Poisson's ratio of the covering. Polyurethane rubber is nearly incompressible (0.5). At
/// 0.45 the bulk modulus is ten times the shear modulus, and at ten layers the spread fitted
/// with the averaged volume (0.463 thicknesses) and with plain elements (0.454) agree. At
/// 0.49 plain elements lock (0.405 and falling with fewer layers) and averaged ones show the
/// point load as a checkerboard.
pub const POISSON_RATIO: f64 = 0.45;

/// A covering to compute.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slab {
    /// Elements from the centre to each side; 50 for the dissertation's 100 nodes a side.
    pub half_width: usize,
    /// Layers of elements.
    pub n_layers: usize,
    /// Poisson's ratio, 0 to 0.495.
    pub poisson_ratio: f64,
}

/// Error of a slab that cannot be computed.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum SlabError {
    /// The number of elements is out of range.
    #[error("{field} is {found}, expected {low} to {high}")]
    Size {
        /// The field's name.
        field: &'static str,
        /// The given number.
        found: usize,
        /// The smallest permitted value.
        low: usize,
        /// The largest permitted value.
        high: usize,
    },
    /// Poisson's ratio is out of range.
    #[error("poisson_ratio is {found}, expected 0 to 0.495")]
    PoissonRatio {
        /// The given ratio.
        found: f64,
    },
    /// The iteration did not converge.
    #[error(transparent)]
    Solve(#[from] SolveError),
}

/// The response at the bottom of a covering to a unit point load.
#[derive(Clone, Debug, PartialEq)]
pub struct PointResponse {
    half_width: usize,
    n_layers: usize,
    /// Row-major over the quarter x, y ≥ 0, (half_width + 1)² nodes.
    forces: Vec<f64>,
    n_iterations: usize,
}

/// A Gaussian fitted to a response.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GaussianFit {
    /// Standard deviation, in elements.
    pub sigma: f64,
    /// Cosine of the two images.
    pub cosine: f64,
    /// Pearson's correlation of the two images.
    pub pearson: f64,
}

/// Computes the response of a slab.
///
/// # Errors
/// [`SlabError`] for a size or ratio out of range, or when the iteration does not converge.
pub fn point_response(slab: &Slab) -> Result<PointResponse, SlabError> {
    let within = |field, found, low, high| match found {
        found if (low..=high).contains(&found) => Ok(()),
        _ => Err(SlabError::Size { field, found, low, high }),
    };
    within("half_width", slab.half_width, 2, 200)?;
    within("n_layers", slab.n_layers, 1, 40)?;
    if !(0.0..=0.495).contains(&slab.poisson_ratio) {
        return Err(SlabError::PoissonRatio { found: slab.poisson_ratio });
    }
    let quarter = Quarter::new(slab.half_width, slab.n_layers, slab.poisson_ratio);
    let mut load = quarter.zeros();
    // A quarter of the load acts on this quarter of the covering.
    load[quarter.degree(0, 0, slab.n_layers) + 2] = -0.25;
    let solution = solve(&quarter, &load)?;
    let n = slab.half_width + 1;
    let bottom = quarter.forces(&solution.displacements);
    let forces = (0..n * n).map(|node| {
        let (x, y) = (node % n, node / n);
        // Nodes on a plane of symmetry belong to two quarters, the middle one to four.
        let shared = if x == 0 { 2.0 } else { 1.0 } * if y == 0 { 2.0 } else { 1.0 };
        shared * bottom[quarter.degree(x, y, 0) + 2]
    });
    let forces = forces.collect();
    let (half_width, n_layers) = (slab.half_width, slab.n_layers);
    Ok(PointResponse { half_width, n_layers, forces, n_iterations: solution.n_iterations })
}

impl PointResponse {
    /// The upward force of the bottom node at (x, y) elements from the centre; 0 beyond the
    /// slab. All of them sum to the load, 1.
    #[must_use]
    pub fn force(&self, x: i64, y: i64) -> f64 {
        let (x, y) = (x.unsigned_abs() as usize, y.unsigned_abs() as usize);
        if x.max(y) > self.half_width {
            return 0.0;
        }
        self.forces[y * (self.half_width + 1) + x]
    }

    /// Elements from the centre to each side.
    #[must_use]
    pub fn half_width(&self) -> usize {
        self.half_width
    }

    /// Layers of elements.
    #[must_use]
    pub fn n_layers(&self) -> usize {
        self.n_layers
    }

    /// Number of iterations of the solver.
    #[must_use]
    pub fn n_iterations(&self) -> usize {
        self.n_iterations
    }

    /// All forces, row-major over the whole bottom, (2 · half width + 1)² nodes.
    #[must_use]
    pub fn image(&self) -> Vec<f64> {
        let reach = self.half_width as i64;
        (-reach..=reach).flat_map(|y| (-reach..=reach).map(move |x| self.force(x, y))).collect()
    }

    /// The forces along a line through the centre.
    #[must_use]
    pub fn profile(&self) -> Vec<(f64, f64)> {
        let reach = self.half_width as i64;
        (-reach..=reach).map(|x| (x as f64, self.force(x, 0))).collect()
    }

    /// The Gaussian (equation 2.2 as corrected) with the greatest cosine to the forces.
    #[must_use]
    pub fn gaussian(&self) -> GaussianFit {
        let forces = self.image();
        let quality = |sigma: f64| cosine(&forces, &self.gaussian_image(sigma));
        let sigma = golden_maximum(quality, 0.2, 0.5 * self.half_width as f64);
        let pearson = pearson(&forces, &self.gaussian_image(sigma));
        GaussianFit { sigma, cosine: quality(sigma), pearson }
    }

    fn gaussian_image(&self, sigma: f64) -> Vec<f64> {
        let reach = self.half_width as i64;
        let weight = |x: i64| (-0.5 * (x as f64 / sigma).powi(2)).exp();
        let line: Vec<f64> = (-reach..=reach).map(weight).collect();
        line.iter().flat_map(|y| line.iter().map(move |x| x * y)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn response(half_width: usize, n_layers: usize, poisson_ratio: f64) -> PointResponse {
        point_response(&Slab { half_width, n_layers, poisson_ratio }).unwrap()
    }

    #[test]
    fn bottom_forces_sum_to_the_load_and_are_symmetric() {
        for (n_layers, poisson_ratio) in [(1, 0.0), (3, 0.3), (3, POISSON_RATIO), (4, 0.49)] {
            let response = response(12, n_layers, poisson_ratio);
            let sum: f64 = response.image().iter().sum();
            assert!((sum - 1.0).abs() < 1e-6, "{n_layers} layers, {poisson_ratio}: {sum}");
            let scale = response.force(0, 0);
            for (x, y) in [(1, 0), (3, 1), (5, 2), (7, 7)] {
                let (here, mirrored) = (response.force(x, y), response.force(y, -x));
                assert!((here - mirrored).abs() < 1e-6 * scale, "at {x}, {y}");
            }
        }
    }

    #[test]
    fn force_is_greatest_under_the_load_and_decays() {
        let response = response(32, 8, POISSON_RATIO);
        let along: Vec<f64> = (0..=8).map(|x| response.force(x, 0)).collect();
        assert!(along.windows(2).all(|pair| pair[0] > pair[1]), "{along:?}");
        assert!(response.force(28, 0).abs() < 1e-2 * along[0], "{}", response.force(28, 0));
    }

    #[test]
    fn halving_the_elements_hardly_changes_the_spread() {
        // The same slab, four times as far to each side as it is thick.
        let coarse = response(20, 5, POISSON_RATIO).gaussian().sigma / 5.0;
        let fine = response(40, 10, POISSON_RATIO).gaussian().sigma / 10.0;
        assert!((coarse / fine - 1.0).abs() < 0.05, "{coarse} and {fine} thicknesses");
    }

    #[test]
    fn the_fit_recovers_a_gaussian() {
        let mut response = response(12, 2, 0.3);
        let gaussian = response.gaussian_image(2.5);
        let n = 13;
        let at = |x: usize, y: usize| gaussian[(y + 12) * 25 + x + 12];
        response.forces = (0..n * n).map(|node| at(node % n, node / n)).collect();
        let fit = response.gaussian();
        assert!((fit.sigma - 2.5).abs() < 1e-4 && (fit.cosine - 1.0).abs() < 1e-9, "{fit:?}");
    }

    #[test]
    fn invalid_slabs_are_refused() {
        let slab = Slab { half_width: 8, n_layers: 2, poisson_ratio: 0.5 };
        assert_eq!(point_response(&slab), Err(SlabError::PoissonRatio { found: 0.5 }));
        let flat = Slab { n_layers: 0, poisson_ratio: 0.3, ..slab };
        let error = SlabError::Size { field: "n_layers", found: 0, low: 1, high: 40 };
        assert_eq!(point_response(&flat), Err(error));
    }
}
