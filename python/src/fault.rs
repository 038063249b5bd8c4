//! Errors for Python: a `ValueError` whose message begins with the argument's name.

use std::fmt::Display;

use pyo3::PyErr;
use pyo3::exceptions::PyValueError;

/// The error of an argument.
pub(crate) fn of(argument: impl Display, detail: impl Display) -> PyErr {
    PyValueError::new_err(format!("{argument}: {detail}"))
}

/// Checks that a number is finite and within a range.
pub(crate) fn within(argument: &str, found: f64, low: f64, high: f64) -> Result<f64, PyErr> {
    if (low..=high).contains(&found) {
        return Ok(found);
    }
    Err(of(argument, format!("came {found}, expected a number from {low} to {high}")))
}

/// Checks that a count is within a range.
pub(crate) fn count(argument: &str, found: usize, low: usize, high: usize) -> Result<usize, PyErr> {
    if (low..=high).contains(&found) {
        return Ok(found);
    }
    Err(of(argument, format!("came {found}, expected {low} to {high}")))
}
