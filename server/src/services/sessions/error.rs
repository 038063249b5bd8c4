//! Errors of sessions.

use std::time::Duration;

use thiserror::Error;

use crate::budget::ShareFull;
use crate::cause::Cause;
use crate::live::error::LiveError;
use crate::services::catalogues::error::CatalogueError;
use crate::services::keys::error::KeyError;
use crate::wire::life::OtherTruth;

/// Error of sessions.
#[derive(Debug, Error)]
pub(crate) enum SessionError {
    #[error(
        "{max} sessions are open, which is the maximum: close finished ones, or let them expire \
         (`ttl_s`)"
    )]
    Full { max: usize, wait: Option<Duration> },
    #[error(transparent)]
    ShareFull(#[from] ShareFull),
    #[error(transparent)]
    OtherTruth(#[from] OtherTruth),
    #[error(transparent)]
    Live(#[from] LiveError),
    #[error(transparent)]
    Catalogue(#[from] CatalogueError),
    #[error(transparent)]
    Key(#[from] KeyError),
    #[error(transparent)]
    Cause(Cause),
}

impl<E: Into<Cause>> From<E> for SessionError {
    fn from(error: E) -> Self {
        Self::Cause(error.into())
    }
}
