//! The prior over the objects, and the error of a reading or a prior that does not fit a
//! catalogue.

use thiserror::Error;

use crate::log_prob::normalize;

/// Error of a reading or a prior that does not fit a catalogue.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum MismatchError {
    /// The image has another shape than the catalogue's images.
    #[error(
        "image of {found_rows}×{found_cols} taxels, expected {rows}×{cols} as in the catalogue"
    )]
    Shape {
        /// Rows of the catalogue's images.
        rows: usize,
        /// Columns of the catalogue's images.
        cols: usize,
        /// Rows of the image.
        found_rows: usize,
        /// Columns of the image.
        found_cols: usize,
    },
    /// The prior does not fit the catalogue.
    #[error(
        "prior over {found} objects, expected {expected} finite weights of at least 0, not all 0"
    )]
    Prior {
        /// Objects of the catalogue.
        expected: usize,
        /// Number of weights.
        found: usize,
    },
}

/// ln of a prior over the objects, normalised; `None` is uniform.
///
/// # Errors
/// [`MismatchError::Prior`] unless there is one finite weight of at least 0 per object, not all 0.
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
