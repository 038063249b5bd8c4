//! Errors of jobs, and of what jobs do, to problems.

use palpate_schemas::ProblemType;

use super::{Answer, catalogue, cause, overloaded};
use crate::services::jobs::error::JobError;
use crate::services::recalibration::RecalibrationError;
use crate::services::shadow::ShadowError;

pub(super) fn job(error: &JobError) -> Answer {
    match error {
        JobError::Finished { .. } => ProblemType::WrongState.into(),
        JobError::QueueFull { waiting } => overloaded("trainings", "trainings", *waiting),
        JobError::Catalogue(error) => catalogue(error),
        JobError::Recalibration(error) => recalibration(error),
        JobError::Shadow(error) => shadow(error),
        JobError::Cause(error) => cause(error),
    }
}

fn recalibration(error: &RecalibrationError) -> Answer {
    match error {
        RecalibrationError::FewSessions { .. }
        | RecalibrationError::OneTouched { .. }
        | RecalibrationError::OneObject { .. }
        | RecalibrationError::NoPart(_)
        | RecalibrationError::Stopped => ProblemType::WrongState.into(),
        RecalibrationError::Cause(error) => cause(error),
    }
}

fn shadow(error: &ShadowError) -> Answer {
    match error {
        ShadowError::NoSessions { .. }
        | ShadowError::NothingReplayed { .. }
        | ShadowError::NoPart(_)
        | ShadowError::Stopped => ProblemType::WrongState.into(),
        ShadowError::Cause(error) => cause(error),
    }
}
