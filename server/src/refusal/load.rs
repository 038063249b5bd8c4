//! Errors of a server that has too much to do.

use std::time::Duration;

use thiserror::Error;

use crate::budget::ShareFull;
use crate::limits::Bound;

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
    #[error("bodies in transit take {used} of {max} bytes: this one does not fit")]
    BodiesFull { used: usize, max: usize },
    #[error("unread answers take {used} of {max} bytes: this one does not fit")]
    AnswersFull { used: usize, max: usize },
    #[error("{open} connections are open, which is the maximum: only health checks are answered")]
    ConnectionsFull { open: usize },
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
