//! Causes of errors that several services share: the enum of each service wraps them, and a
//! service without errors of its own returns them.

use palpate_store::engine::EngineError;
use palpate_store::error::StoreError;
use palpate_store::journal::AppendError;
use thiserror::Error;
use uuid::Uuid;

use crate::compute::ComputeError;
use crate::known_sensors::UnknownSensor;
use crate::wire::Invalid;

/// Cause of an error in any service.
#[derive(Debug, Error)]
pub(crate) enum Cause {
    #[error("there is no {what} {reference:?}")]
    NotFound { what: &'static str, reference: String },
    #[error(transparent)]
    Invalid(#[from] Invalid),
    #[error("{what} is needed: {by}")]
    Needed { what: String, by: String },
    #[error(
        "reading {seq} of robot {robot:?} is already stored with different content: a driver that \
         started again goes on with its numbers, or begins a session"
    )]
    ReadingConflict { pointer: String, robot: String, seq: u64 },
    #[error(
        "the {what} has {found} readings, and at most {max} are allowed: {more} more do not fit"
    )]
    ReadingsFull { what: &'static str, found: u64, more: usize, max: usize },
    #[error("the stored data of {what} {id} cannot be used: {reason}")]
    Unusable { what: &'static str, id: String, reason: String },
    #[error(transparent)]
    UnknownSensor(#[from] UnknownSensor),
    #[error(transparent)]
    Compute(#[from] ComputeError),
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error("a task of the server panicked")]
    Panicked,
}

impl Cause {
    /// Nothing of this kind has the id, name or number.
    pub(crate) fn unknown(what: &'static str, reference: impl ToString) -> Self {
        Self::NotFound { what, reference: reference.to_string() }
    }

    /// One wrong field.
    pub(crate) fn field(pointer: impl Into<String>, detail: impl ToString) -> Self {
        Self::Invalid(Invalid::field(pointer, detail))
    }
}

impl From<AppendError> for Cause {
    fn from(error: AppendError) -> Self {
        match error {
            AppendError::Store(error) => Self::Store(error),
            AppendError::Sequence { .. } | AppendError::Retracted { .. } => {
                Self::Store(StoreError::Changed { what: "journal", id: Uuid::nil() })
            }
            AppendError::Repeated { robot, seq, .. } => {
                Self::ReadingConflict { pointer: "/readings".to_owned(), robot, seq }
            }
            AppendError::RobotLength { .. } => Self::field("/readings", error),
        }
    }
}

impl From<EngineError> for Cause {
    fn from(error: EngineError) -> Self {
        Self::Store(error.into())
    }
}
