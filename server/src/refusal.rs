//! Reasons for which the server refuses a request: those of the services, and its own, of the
//! request's sender, its form and the server's load. `problem` maps them to HTTP.

use std::time::Duration;

use axum::http::HeaderName;
use palpate_core::units::Bytes;
use palpate_schemas::{FieldError, Readiness, Role};
use palpate_store::access::AccessKey;
use thiserror::Error;

use crate::budget::ShareFull;
use crate::cause::Cause;
use crate::limits::Bound;
use crate::roles;
use crate::services::catalogues::CatalogueError;
use crate::services::jobs::error::JobError;
use crate::services::keys::error::{KeyError, KeyFault};
use crate::services::objects::ObjectError;
use crate::services::sessions::SessionError;
use crate::services::webhooks::error::WebhookError;
use crate::wire;

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
    Webhook(#[from] WebhookError),
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

/// Error of who sends a request, from where, and with which method.
#[derive(Debug, Error)]
pub(crate) enum AccessError {
    #[error(transparent)]
    Unauthenticated(#[from] KeyFault),
    #[error(
        "the key {:?} has the role {}, expected {}", key.name, role_name(key.role), needed(roles)
    )]
    Forbidden { key: Box<AccessKey>, roles: &'static [Role] },
    #[error("this path exists, but not with this method; the header `Allow` lists which")]
    OtherMethod { allow: String },
    #[error(
        "the request addresses the host {host:?}: a server without keys answers only to its own \
         names, such as 127.0.0.1 or localhost; in a network also to its addresses and to the \
         names that `--host-name` lists"
    )]
    ForeignHost { host: String },
    #[error("pages of {origin} may not use this server: allow them with `--cors-origin {origin}`")]
    ForeignOrigin { origin: String },
}

/// Error of a request's form: of its body, its path and its headers.
#[derive(Debug, Error)]
pub(crate) enum RequestError {
    #[error("the body is not {format}: {reason}")]
    Malformed { format: &'static str, reason: String, errors: Vec<FieldError> },
    #[error("the header `{name}` came {found} times, expected once")]
    Repeated { name: HeaderName, found: usize },
    #[error("the header `Host` is {found:?}, expected one host with or without a port")]
    Host { found: String },
    #[error("the request's path or body cannot be read: {reason}")]
    Unreadable { reason: String },
    #[error("the body is longer than {}{}", Bytes(*.max as u64), .advice)]
    BodyTooLarge { max: usize, advice: &'static str },
    #[error(
        "the values of the body take more than {} of memory: send them in several requests",
        Bytes(*.max as u64)
    )]
    BodyTooHeavy { max: usize },
    #[error("the body did not arrive within {within:?}")]
    BodyTooSlow { within: Duration },
    #[error("the content type is {found:?}, expected {expected}")]
    ContentType { found: String, expected: &'static str },
    #[error(
        "the content encoding is {found:?}, expected none: bodies are not compressed, leave the \
         header `content-encoding` out"
    )]
    ContentEncoding { found: String },
    #[error("the header `If-Match` is missing: expected the `ETag` of the resource to change")]
    RevisionMissing,
}

/// Error of a request beyond what the server can do now.
#[derive(Debug, Error)]
pub(crate) enum LoadError {
    #[error(
        "each client may send {} requests a second: try again in {:.1} s", bound.limit,
        wait.as_secs_f64()
    )]
    RateExceeded { bound: Bound, wait: Duration },
    #[error(
        "{} changes with one key have failed within a minute, which is the maximum: find the \
         cause, and try again in {:.1} s", bound.limit, wait.as_secs_f64()
    )]
    FailuresExceeded { bound: Bound, wait: Duration },
    #[error(
        "requests in progress take {} of {} with their bodies and the values in these: this one \
         does not fit",
        Bytes(*.used as u64), Bytes(*.max as u64)
    )]
    BodiesFull { used: usize, max: usize },
    #[error(
        "unread answers take {} of {}: this one does not fit",
        Bytes(*.used as u64), Bytes(*.max as u64)
    )]
    AnswersFull { used: usize, max: usize },
    #[error("{open} event streams are open, which is the maximum")]
    StreamsFull { open: usize },
    #[error("{under_way} requests are in progress, which is the maximum")]
    RequestsFull { under_way: usize },
    #[error(
        "no answer within {within:?}; the request may have been stored: repeat readings with the \
         same robot and seq"
    )]
    TooSlow { within: Duration },
    #[error(transparent)]
    ShareFull(#[from] ShareFull),
}

/// What to do about a mesh file that is too long.
pub(crate) const SMALLER_MESH: &str = ": decimate the mesh (touch feels nothing finer than 0.1 mm), \
    or send it as binary PLY, GLB or 3MF, which are half as long as STL or shorter";

fn role_name(role: palpate_store::access::Role) -> &'static str {
    roles::name(wire::access::role(role))
}

fn needed(roles: &[Role]) -> String {
    match roles {
        [] => "a role that no key has".to_owned(),
        [only] => format!("the role {}", roles::name(*only)),
        several => format!("one of the roles {}", roles::listed(several)),
    }
}
