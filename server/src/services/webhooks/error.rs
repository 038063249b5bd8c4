//! Errors of webhooks.

use thiserror::Error;
use uuid::Uuid;

use crate::cause::Cause;

/// Error of webhooks.
#[derive(Debug, Error)]
pub(crate) enum WebhookError {
    #[error("there are {max} webhooks, which is the maximum: delete one")]
    Full { max: usize },
    #[error("webhook {id} is disabled: enable it first")]
    Disabled { id: Uuid },
    #[error("delivery {event} is being attempted right now: wait for its outcome")]
    InFlight { event: Uuid },
    #[error("the operating system provides no random bits")]
    NoRandom(#[from] getrandom::Error),
    #[error(transparent)]
    Cause(Cause),
}

impl<E: Into<Cause>> From<E> for WebhookError {
    fn from(error: E) -> Self {
        Self::Cause(error.into())
    }
}
