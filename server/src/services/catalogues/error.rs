//! Errors of catalogues, versions and models.

use palpate_store::catalogue::AdoptError;
use thiserror::Error;

use crate::cause::Cause;
use crate::limits::megabytes;
use crate::model::NoPart;
use crate::wire::training::Unreadable;

/// Error of a catalogue, a version or a model.
#[derive(Debug, Error)]
pub(crate) enum CatalogueError {
    #[error("catalogue {catalogue:?} has no version {version}")]
    NoVersion { catalogue: String, version: u32 },
    #[error("catalogue {catalogue:?} has no current version: train it first")]
    Untrained { catalogue: String },
    #[error("the revision is {found}, `If-Match` expects {expected}")]
    RevisionChanged { expected: String, found: u64 },
    #[error(
        "the {part} of version {version} of catalogue {catalogue:?} need {} of memory, more than \
         the {} for models: raise `--model-memory-mb`",
        megabytes(*.needed), megabytes(*.budget)
    )]
    ModelTooLarge { catalogue: String, version: u32, part: &'static str, needed: u64, budget: u64 },
    #[error(
        "version {version} of catalogue {catalogue:?} needs {} of memory, and the models in use \
         already take {} of {}",
        megabytes(*.needed), megabytes(*.in_use), megabytes(*.budget)
    )]
    ModelsInUse { catalogue: String, version: u32, needed: u64, in_use: u64, budget: u64 },
    #[error(
        "version {version} of catalogue {catalogue:?} is damaged ({reason}): use another version, \
         train a new one, or restore a snapshot"
    )]
    Quarantined { catalogue: String, version: u32, reason: String },
    #[error(
        "version {version} of catalogue {catalogue:?} has another content here, {found}, than that \
         of the session, {expected}"
    )]
    OtherContent { catalogue: String, version: u32, expected: String, found: String },
    #[error(transparent)]
    Adopt(#[from] AdoptError),
    #[error(transparent)]
    NoPart(#[from] NoPart),
    #[error(transparent)]
    Unreadable(#[from] Unreadable),
    #[error(transparent)]
    Cause(Cause),
}

impl<E: Into<Cause>> From<E> for CatalogueError {
    fn from(error: E) -> Self {
        Self::Cause(error.into())
    }
}
