//! Errors of one session in memory.

use thiserror::Error;
use uuid::Uuid;

use crate::cause::Cause;
use crate::limits::megabytes;
use crate::wire::life::End;

/// Error of one session in memory.
#[derive(Debug, Error)]
pub(crate) enum LiveError {
    #[error(
        "session {session} {end}; it accepts no more readings, but its readings and its belief can \
         still be read"
    )]
    Ended { session: Uuid, end: End },
    #[error(
        "{waiting} requests already wait for this session: send several readings in one request, \
         or fewer requests at once"
    )]
    Busy { waiting: usize },
    #[error(
        "session {session} has no marginals: its method keeps no pose distribution, or its \
         readings rule the object out"
    )]
    NoMarginals { session: Uuid },
    #[error(
        "session {session} has the method `{method}`, which cannot rank next touches: expected \
         `surface`"
    )]
    NoNextTouches { session: Uuid, method: &'static str },
    #[error(
        "session {session} has no touch yet: expected a `workspace` (center and radius of a ball \
         that contains the object), or a reading that touches the object"
    )]
    NoTouch { session: Uuid },
    #[error(
        "session {session} rests on {found} readings, and at most {max} can be explained: name an \
         earlier revision with `?at=`"
    )]
    TooManyToExplain { session: Uuid, found: usize, max: usize },
    #[error(
        "beliefs in use take {} of memory, and at most {} are allowed",
        megabytes(*bytes as u64), megabytes(*max as u64)
    )]
    BeliefsFull { bytes: usize, max: usize },
    #[error(transparent)]
    Cause(Cause),
}

impl<E: Into<Cause>> From<E> for LiveError {
    fn from(error: E) -> Self {
        Self::Cause(error.into())
    }
}
