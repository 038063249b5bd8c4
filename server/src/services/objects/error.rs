//! Errors of objects.

use thiserror::Error;
use uuid::Uuid;

use crate::cause::Cause;
use crate::wire::object::FormatError;

/// Error of an object's change.
#[derive(Debug, Error)]
pub(crate) enum ObjectError {
    #[error("object {object:?} is being trained by job {job}: cancel the job first")]
    InTraining { object: String, job: Uuid },
    #[error(transparent)]
    Format(#[from] FormatError),
    #[error(transparent)]
    Cause(Cause),
}

impl<E: Into<Cause>> From<E> for ObjectError {
    fn from(error: E) -> Self {
        Self::Cause(error.into())
    }
}
