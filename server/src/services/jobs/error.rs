//! Errors of jobs.

use palpate_schemas::JobState;
use thiserror::Error;
use uuid::Uuid;

use crate::cause::Cause;
use crate::services::catalogues::CatalogueError;
use crate::services::recalibration::RecalibrationError;
use crate::services::shadow::ShadowError;

/// Error of jobs.
#[derive(Debug, Error)]
pub(crate) enum JobError {
    #[error("job {job} has already ended: {}", state.name())]
    Finished { job: Uuid, state: JobState },
    #[error("{waiting} trainings are already waiting, which is the maximum")]
    QueueFull { waiting: usize },
    #[error(transparent)]
    Catalogue(#[from] CatalogueError),
    #[error(transparent)]
    Recalibration(#[from] RecalibrationError),
    #[error(transparent)]
    Shadow(#[from] ShadowError),
    #[error(transparent)]
    Cause(Cause),
}

impl<E: Into<Cause>> From<E> for JobError {
    fn from(error: E) -> Self {
        Self::Cause(error.into())
    }
}
