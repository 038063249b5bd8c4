//! Reasons for which the server refuses a request: those of the services, and its own.
//! `problem` maps them to HTTP.

pub(crate) mod access;
pub(crate) mod load;
pub(crate) mod request;

use palpate_schemas::Readiness;
use thiserror::Error;

use crate::cause::Cause;
use crate::services::catalogues::error::CatalogueError;
use crate::services::jobs::error::JobError;
use crate::services::keys::error::KeyError;
use crate::services::objects::error::ObjectError;
use crate::services::sessions::SessionError;
use access::AccessError;
use load::LoadError;
use request::RequestError;

/// Reason for which a request was refused.
#[derive(Debug, Error)]
pub(crate) enum Refusal {
    #[error(transparent)]
    Cause(Cause),
    #[error(transparent)]
    Key(#[from] KeyError),
    #[error(transparent)]
    Object(#[from] ObjectError),
    #[error(transparent)]
    Catalogue(#[from] CatalogueError),
    #[error(transparent)]
    Session(#[from] SessionError),
    #[error(transparent)]
    Job(#[from] JobError),
    #[error(transparent)]
    Access(#[from] AccessError),
    #[error(transparent)]
    Request(#[from] RequestError),
    #[error(transparent)]
    Load(#[from] LoadError),
    #[error("the server is not ready")]
    NotReady(Readiness),
}

impl<E: Into<Cause>> From<E> for Refusal {
    fn from(error: E) -> Self {
        Self::Cause(error.into())
    }
}
