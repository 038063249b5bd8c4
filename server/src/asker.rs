//! The asker of a request: the client that its work counts to, and whether it still waits.
//!
//! It goes with the request's task (a task-local), because everything between the door and the
//! compute pool would have to pass it on. When the request ends before its answer, because the
//! client has gone or the time for answers is up, its computations are asked to end: at once
//! between two readings, and within a reading after [`GRACE`], which costs the belief in memory.

use std::time::Duration;

use palpate_core::stop::Stop;
use tokio::task::JoinHandle;
use uuid::Uuid;

use crate::client::Client;

/// How long a reading that is being folded may take to its end. Chosen: a few times what one
/// takes, and half of the second after which a core is given back.
const GRACE: Duration = Duration::from_millis(500);

tokio::task_local! {
    static ASKER: Asker;
}

/// Who asks. The default asks for nobody and never ends.
#[derive(Clone, Debug, Default)]
pub(crate) struct Asker {
    client: Option<Client>,
    /// Asked for when nobody waits for an answer.
    gone: Stop,
    /// Asked for a moment later.
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

    /// The client that work counts to.
    pub(crate) fn client(&self) -> Option<Client> {
        self.client
    }

    /// The key that what is written is written with.
    pub(crate) fn key(&self) -> Option<Uuid> {
        match self.client {
            Some(Client::Key(key)) => Some(key),
            Some(Client::Address(_)) | None => None,
        }
    }

    /// Whether nobody waits for an answer any more.
    pub(crate) fn is_gone(&self) -> bool {
        self.gone.is_asked()
    }

    /// What loops within a reading heed.
    pub(crate) fn overdue(&self) -> &Stop {
        &self.overdue
    }

    /// Asks the work to end.
    fn leave(&self) {
        self.gone.ask();
        let overdue = self.overdue.clone();
        let asking = async move {
            tokio::time::sleep(GRACE).await;
            overdue.ask();
        };
        match tokio::runtime::Handle::try_current() {
            Ok(runtime) => drop(runtime.spawn(asking)),
            // The server is going down.
            Err(_) => self.overdue.ask(),
        }
    }
}

/// Leaves when it is dropped before the answer.
struct Waiting(Option<Asker>);

impl Drop for Waiting {
    fn drop(&mut self) {
        if let Some(asker) = self.0.take() {
            asker.leave();
        }
    }
}

/// Does what a client asks for. Dropped before its end, it takes its computations with it.
pub(crate) async fn ask<T>(client: Option<Client>, work: impl Future<Output = T>) -> T {
    let asker = Asker::new(client);
    let mut waiting = Waiting(Some(asker.clone()));
    let answer = ASKER.scope(asker, work).await;
    waiting.0 = None;
    answer
}

/// Goes on with the asker's work in a task of its own, which ends by itself when the asker has
/// gone: nothing is left half done.
pub(crate) fn spawn<T: Send + 'static>(
    work: impl Future<Output = T> + Send + 'static,
) -> JoinHandle<T> {
    tokio::spawn(ASKER.scope(Asker::current(), work))
}

/// The same for work that others wait for too: it may take the time `within` though the asker has
/// gone.
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
    async fn work_that_nobody_waits_for_is_asked_to_end() {
        let (sender, asker) = tokio::sync::oneshot::channel();
        let asked = ask(None, async {
            // Through a task of its own, as changes are made.
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
