//! Errors of the form of a request: of its body, its path and its headers.

use std::time::Duration;

use palpate_schemas::FieldError;
use thiserror::Error;

/// Error of a request's form.
#[derive(Debug, Error)]
pub(crate) enum RequestError {
    #[error("the body is not {format}: {reason}")]
    Malformed { format: &'static str, reason: String, errors: Vec<FieldError> },
    #[error("the request's path or body cannot be read: {reason}")]
    Unreadable { reason: String },
    #[error("the body is longer than {max} bytes")]
    BodyTooLarge { max: usize },
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
