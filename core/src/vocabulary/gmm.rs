//! Gaussian mixtures with full covariances: soft classes of appearance.
//!
//! Source: section 4.4.2.1, equations 4.15–4.17. A feature belongs to a class by its
//! responsibility, so that every feature has mass 1 (`docs/equations.md`, row 4.17).
//! Everything is in the log domain. Not here: histograms (`bag`).

mod fit;
mod steps;

use nalgebra::{Cholesky, DMatrix};
use thiserror::Error;

use crate::log_prob;
pub use fit::{Covariances, MixtureConfig, MixtureFit, fit_mixture, fit_mixture_while};

/// Rounding tolerance of weights that sum to 1.
const WEIGHTS_TOLERANCE: f64 = 1e-12;

/// One Gaussian of a mixture.
#[derive(Clone, Debug, PartialEq)]
pub struct Component {
    /// Weight of the component, above 0.
    pub weight: f64,
    /// Its mean.
    pub mean: Vec<f64>,
    /// Its covariance, row-major (it is symmetric).
    pub covariance: Vec<f64>,
}

/// Error of numbers that are not a mixture.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum MixtureError {
    /// There is no component.
    #[error("a mixture of 0 components, expected at least 1")]
    Empty,
    /// A weight is not positive and finite.
    #[error("component {component} has weight {found}, expected more than 0 and at most 1")]
    Weight {
        /// Index of the component.
        component: usize,
        /// Its weight.
        found: f64,
    },
    /// A mean or covariance has the wrong size.
    #[error("component {component} does not have {expected} dimensions like the first")]
    Dimension {
        /// Index of the component.
        component: usize,
        /// Dimensions of the first component.
        expected: usize,
    },
    /// A covariance is not positive definite.
    #[error("the covariance of component {component} is not positive definite")]
    Covariance {
        /// Index of the component.
        component: usize,
    },
}

/// A component prepared for evaluation: ln of its density is `log_scale` − ½ ‖`whitening`·x −
/// `whitened_mean`‖².
#[derive(Clone, Debug, PartialEq)]
struct Whitened {
    /// The inverse of the covariance's Cholesky factor, lower triangular.
    whitening: DMatrix<f64>,
    whitened_mean: Vec<f64>,
    /// ln weight − ½ ln |2π·covariance|.
    log_scale: f64,
}

/// A mixture of Gaussians over features of one length.
#[derive(Clone, Debug, PartialEq)]
pub struct Mixture {
    components: Vec<Component>,
    whitened: Vec<Whitened>,
}

impl Mixture {
    /// A mixture of components; their weights are normalised to sum to 1. Weights that do so
    /// but for rounding are kept, so that a stored mixture is restored bit by bit.
    ///
    /// # Errors
    /// [`MixtureError`] names the first invalid component.
    pub fn new(mut components: Vec<Component>) -> Result<Self, MixtureError> {
        let expected = components.first().ok_or(MixtureError::Empty)?.mean.len();
        for (component, part) in components.iter().enumerate() {
            let found = part.weight;
            if !(found > 0.0 && found <= 1.0 + 1e-9) {
                return Err(MixtureError::Weight { component, found });
            }
            if (part.mean.len(), part.covariance.len()) != (expected, expected * expected) {
                return Err(MixtureError::Dimension { component, expected });
            }
        }
        let total: f64 = components.iter().map(|component| component.weight).sum();
        if (total - 1.0).abs() > WEIGHTS_TOLERANCE {
            components.iter_mut().for_each(|component| component.weight /= total);
        }
        let whitened = components
            .iter()
            .enumerate()
            .map(|(index, part)| {
                Whitened::of(part).ok_or(MixtureError::Covariance { component: index })
            })
            .collect::<Result<_, _>>()?;
        Ok(Self { components, whitened })
    }

    /// The Gaussians, in the order of the classes.
    #[must_use]
    pub fn components(&self) -> &[Component] {
        &self.components
    }

    /// The length of features.
    #[must_use]
    pub fn dimension(&self) -> usize {
        self.components[0].mean.len()
    }

    /// ln Pr(x|g_i)·Pr(g_i) for every component (the terms of equation 4.15).
    #[must_use]
    pub fn log_joint(&self, feature: &[f64]) -> Vec<f64> {
        self.whitened.iter().map(|part| part.log_joint(feature)).collect()
    }

    /// Pr(g_i|x) for every component: they sum to 1.
    #[must_use]
    pub fn responsibilities(&self, feature: &[f64]) -> Vec<f64> {
        log_prob::normalize(&self.log_joint(feature))
    }

    /// ln of the density at a feature (equation 4.15).
    #[must_use]
    pub fn log_density(&self, feature: &[f64]) -> f64 {
        log_prob::log_sum_exp(self.log_joint(feature).into_iter())
    }
}

impl Whitened {
    /// `None` unless the covariance is positive definite and everything is finite.
    fn of(component: &Component) -> Option<Self> {
        let dimension = component.mean.len();
        let covariance = DMatrix::from_row_slice(dimension, dimension, &component.covariance);
        let factor = Cholesky::new(covariance)?.unpack();
        let whitening = factor.solve_lower_triangular(&DMatrix::identity(dimension, dimension))?;
        let log_root: f64 = factor.diagonal().iter().map(|value| value.ln()).sum();
        let mean = nalgebra::DVector::from_column_slice(&component.mean);
        let whitened_mean: Vec<f64> = (&whitening * mean).iter().copied().collect();
        let log_scale =
            component.weight.ln() - log_root - 0.5 * dimension as f64 * std::f64::consts::TAU.ln();
        let finite = log_scale.is_finite() && whitened_mean.iter().all(|value| value.is_finite());
        finite.then_some(Self { whitening, whitened_mean, log_scale })
    }

    fn log_joint(&self, feature: &[f64]) -> f64 {
        let mut squared = 0.0;
        for (row, mean) in self.whitened_mean.iter().enumerate() {
            let terms = (0..=row).map(|col| self.whitening[(row, col)] * feature[col]);
            squared += (terms.sum::<f64>() - mean).powi(2);
        }
        self.log_scale - 0.5 * squared
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn component(weight: f64, mean: [f64; 2], covariance: [f64; 4]) -> Component {
        Component { weight, mean: mean.to_vec(), covariance: covariance.to_vec() }
    }

    #[test]
    fn the_density_is_the_written_out_gaussian() {
        // Σ = (2 1; 1 2): |Σ| = 3, Σ⁻¹ = (2 −1; −1 2)/3; at (1, 0) from the mean the square
        // is 2/3.
        let mixture = Mixture::new(vec![component(1.0, [3.0, 4.0], [2.0, 1.0, 1.0, 2.0])]).unwrap();
        let expected = -std::f64::consts::TAU.ln() - 0.5 * 3.0_f64.ln() - 1.0 / 3.0;
        assert!((mixture.log_density(&[4.0, 4.0]) - expected).abs() < 1e-12);
    }

    #[test]
    fn responsibilities_are_shares_even_where_densities_vanish() {
        let unit = [1.0, 0.0, 0.0, 1.0];
        let parts = vec![component(0.5, [0.0, 0.0], unit), component(0.5, [2.0, 0.0], unit)];
        let mixture = Mixture::new(parts).unwrap();
        // Half way the shares are equal; exp(−½·1e6) is 0 in f64, the shares are not.
        for far in [0.0, 1_000.0] {
            let shares = mixture.responsibilities(&[1.0, far]);
            assert!((shares[0] - 0.5).abs() < 1e-9, "{shares:?}");
        }
    }

    #[test]
    fn invalid_components_are_refused_by_index() {
        let unit = [1.0, 0.0, 0.0, 1.0];
        assert_eq!(Mixture::new(Vec::new()), Err(MixtureError::Empty));
        let weightless = vec![component(1.0, [0.0; 2], unit), component(0.0, [0.0; 2], unit)];
        assert_eq!(
            Mixture::new(weightless),
            Err(MixtureError::Weight { component: 1, found: 0.0 })
        );
        let flat = vec![component(1.0, [0.0; 2], [1.0, 1.0, 1.0, 1.0])];
        assert_eq!(Mixture::new(flat), Err(MixtureError::Covariance { component: 0 }));
        let short = Component { weight: 1.0, mean: vec![0.0; 2], covariance: vec![1.0] };
        assert_eq!(
            Mixture::new(vec![short]),
            Err(MixtureError::Dimension { component: 0, expected: 2 })
        );
    }
}
