//! The asker of a request: the client that its work counts towards, and whether it still waits.
//!
//! It is a task-local value, since otherwise everything between the connection and the
//! compute pool would have to pass it on. When the request ends before its answer, because
//! the client has gone or the time limit is reached, its computations are cancelled: at once
//! between two readings, and within a reading after [`GRACE`], which costs the belief in
//! memory.

use std::time::Duration;

use palpate_core::stop::Stop;
use tokio::task::JoinHandle;
use uuid::Uuid;

use crate::client::Client;

/// Time for a reading in progress to be folded completely. Chosen: a few times the usual
/// time, and half of the second within which a core must be free again.
const GRACE: Duration = Duration::from_millis(500);

tokio::task_local! {
    static ASKER: Asker;
}

/// The asker of a request. The default is no client and never ends.
#[derive(Clone, Debug, Default)]
pub(crate) struct Asker {
    client: Option<Client>,
    /// Requested when no caller waits for an answer.
    gone: Stop,
    /// Requested [`GRACE`] later.
    overdue: Stop,
}

impl Asker {
    fn new(client: Option<Client>) -> Self {
        Self { client, gone: Stop::possible(), overdue: Stop::possible() }
    }

    /// The asker of this task.
    pub(crate) fn current() -> Self {
        ASKER.try_with(Clone::clone).unwrap_or_default()
    }

    /// The client that the work counts towards.
    pub(crate) fn client(&self) -> Option<Client> {
        self.client
    }

    /// The key under which writes are recorded.
    pub(crate) fn key(&self) -> Option<Uuid> {
        match self.client {
            Some(Client::Key(key)) => Some(key),
            Some(Client::Address(_)) | None => None,
        }
    }

    /// Whether no caller waits for an answer any more.
    pub(crate) fn is_gone(&self) -> bool {
        self.gone.is_asked()
    }

    /// The stop for loops within a reading.
    pub(crate) fn overdue(&self) -> &Stop {
        &self.overdue
    }

    /// Cancels the work.
    fn leave(&self) {
        self.gone.ask();
        let overdue = self.overdue.clone();
        let asking = async move {
            tokio::time::sleep(GRACE).await;
            overdue.ask();
        };
        match tokio::runtime::Handle::try_current() {
            Ok(runtime) => drop(runtime.spawn(asking)),
            // The server is shutting down.
            Err(_) => self.overdue.ask(),
        }
    }
}

/// Cancels the work when it is dropped before the answer.
struct Waiting(Option<Asker>);

impl Drop for Waiting {
    fn drop(&mut self) {
        if let Some(asker) = self.0.take() {
            asker.leave();
        }
    }
}

/// Runs the work of a client. If it is dropped before its end, its computations are cancelled.
pub(crate) async fn ask<T>(client: Option<Client>, work: impl Future<Output = T>) -> T {
    let asker = Asker::new(client);
    let mut waiting = Waiting(Some(asker.clone()));
    let answer = ASKER.scope(asker, work).await;
    waiting.0 = None;
    answer
}

/// Runs work of the current asker in a separate task, which is cancelled by itself when the
/// asker has gone, so that nothing is left half done.
pub(crate) fn spawn<T: Send + 'static>(
    work: impl Future<Output = T> + Send + 'static,
) -> JoinHandle<T> {
    tokio::spawn(ASKER.scope(Asker::current(), work))
}

/// Like `spawn`, for work that others wait for too: it may take the time `within` after the
/// asker has gone.
pub(crate) fn spawn_within<T: Send + 'static>(
    within: Duration,
    work: impl Future<Output = T> + Send + 'static,
) -> JoinHandle<T> {
    let asker = Asker::new(Asker::current().client);
    let working = ASKER.scope(asker.clone(), work);
    tokio::spawn(async move {
        let mut working = std::pin::pin!(working);
        tokio::select! {
            answer = &mut working => answer,
            () = tokio::time::sleep(within) => {
                asker.leave();
                working.await
            }
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn work_without_a_waiting_caller_is_cancelled() {
        let (sender, asker) = tokio::sync::oneshot::channel();
        let asked = ask(None, async {
            // Through a separate task, as for changes.
            spawn(async move { sender.send(Asker::current()).unwrap() }).await.unwrap();
            std::future::pending::<()>().await;
        });
        tokio::time::timeout(Duration::from_millis(50), asked).await.unwrap_err();
        let asker = asker.await.unwrap();
        let answered = ask(None, async { Asker::current() }).await;
        assert!(asker.is_gone() && !asker.overdue().is_asked());
        tokio::time::sleep(2 * GRACE).await;
        assert!(asker.overdue().is_asked());
        assert!(!answered.is_gone() && !answered.overdue().is_asked());
    }
}
