//! The result of a commit that is under way.

use std::future::Future;
use std::pin::Pin;
use std::task::{Context, Poll};

use futures::channel::oneshot;

use super::{CommitError, EngineError};

/// The pending result of a commit. Await it, or block a thread with [`Pending::wait`].
#[derive(Debug)]
pub struct Pending(oneshot::Receiver<Result<(), CommitError>>);

impl Pending {
    /// A pending result and its sender.
    #[must_use]
    pub fn channel() -> (oneshot::Sender<Result<(), CommitError>>, Self) {
        let (sender, receiver) = oneshot::channel();
        (sender, Self(receiver))
    }

    /// A result that is known already.
    #[must_use]
    pub fn ready(answer: Result<(), CommitError>) -> Self {
        let (sender, pending) = Self::channel();
        // The receiver is alive, it is in `pending`.
        let _ = sender.send(answer);
        pending
    }

    /// Blocks this thread until the result is there. Not for async threads.
    ///
    /// # Errors
    /// The result of the commit.
    pub fn wait(self) -> Result<(), CommitError> {
        futures::executor::block_on(self)
    }
}

impl Future for Pending {
    type Output = Result<(), CommitError>;

    fn poll(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Self::Output> {
        Pin::new(&mut self.0)
            .poll(context)
            .map(|answer| answer.unwrap_or(Err(CommitError::Engine(EngineError::Stopped))))
    }
}
