//! The prior over the objects, and why a reading or a prior does not fit a catalogue.

use thiserror::Error;

use crate::log_prob::normalize;

/// Why a reading cannot be used with a catalogue.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum MismatchError {
    /// The sensor has another shape than the one the catalogue was trained with.
    #[error(
        "image of {found_rows}×{found_cols} taxels, expected {rows}×{cols} as in the catalogue"
    )]
    Shape {
        /// Rows of the catalogue's images.
        rows: usize,
        /// Columns of the catalogue's images.
        cols: usize,
        /// Rows that came.
        found_rows: usize,
        /// Columns that came.
        found_cols: usize,
    },
    /// The prior does not fit the catalogue.
    #[error(
        "prior over {found} objects, expected {expected} finite weights of at least 0, not all 0"
    )]
    Prior {
        /// Objects of the catalogue.
        expected: usize,
        /// Weights that came.
        found: usize,
    },
}

/// ln of a prior over the objects, normalised; `None` is even.
///
/// # Errors
/// [`MismatchError::Prior`] when there is not one finite weight of at least 0 an object, or
/// all are 0.
pub fn log_prior(prior: Option<&[f64]>, n_objects: usize) -> Result<Vec<f64>, MismatchError> {
    let logs = match prior {
        None => vec![0.0; n_objects],
        Some(weights) => {
            let valid = weights.iter().all(|weight| weight.is_finite() && *weight >= 0.0);
            if weights.len() != n_objects || !valid || weights.iter().all(|w| *w <= 0.0) {
                let found = weights.len();
                return Err(MismatchError::Prior { expected: n_objects, found });
            }
            weights.iter().map(|weight| weight.ln()).collect()
        }
    };
    Ok(normalize(&logs).into_iter().map(f64::ln).collect())
}
