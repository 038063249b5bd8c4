//! Errors of keys: of opening them, of a request's key, and of their changes.

use palpate_store::access::AccessKey;
use palpate_store::error::StoreError;
use thiserror::Error;

use crate::cause::Cause;

/// Error of keys that cannot be opened.
#[derive(Debug, Error)]
pub(crate) enum OpenError {
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error("the operating system has no random bits: {0}")]
    Random(#[from] getrandom::Error),
}

/// Fault of the key of a request.
#[derive(Clone, Debug, Error)]
pub(crate) enum KeyFault {
    #[error("this server requires an API key: send it as `Authorization: Bearer palpate_…`")]
    Missing,
    #[error("the header `Authorization` holds no key of Palpate, expected `Bearer palpate_…`")]
    NotAKey,
    #[error("the server does not know this API key")]
    Unknown,
    #[error("the API key {:?} was revoked", .0.name)]
    Revoked(Box<AccessKey>),
    #[error("the API key {:?} has expired", .0.name)]
    Expired(Box<AccessKey>),
    #[error("the API key {:?} was rotated, and its previous secret is no longer valid", .0.name)]
    Rotated(Box<AccessKey>),
}

impl KeyFault {
    /// The key meant by the request, if the secret proves it.
    pub(crate) fn key(&self) -> Option<&AccessKey> {
        match self {
            Self::Missing | Self::NotAKey | Self::Unknown => None,
            Self::Revoked(key) | Self::Expired(key) | Self::Rotated(key) => Some(key),
        }
    }
}

/// Error of a change of keys or of robots' names.
#[derive(Debug, Error)]
pub(crate) enum KeyError {
    #[error(
        "the robot name {robot:?} belongs to another key: use another name, or have an \
         administrator assign this one to your key (`PUT /v1/robots/…`)"
    )]
    RobotHeld { pointer: String, robot: String },
    #[error("this key holds {held} robot names, and at most {max} are allowed")]
    RobotsFull { held: usize, max: usize },
    #[error("{name:?} is the last valid admin key: create another one first")]
    LastAdmin { name: String },
    #[error("the key {name:?} was revoked or has expired: create a new one")]
    Refused { name: String },
    #[error("there are {found} keys, which is the maximum, and none of them is revoked")]
    Full { found: usize },
    #[error("the operating system provides no random bits")]
    NoRandom(#[from] getrandom::Error),
    #[error(transparent)]
    Cause(Cause),
}

impl<E: Into<Cause>> From<E> for KeyError {
    fn from(error: E) -> Self {
        Self::Cause(error.into())
    }
}
