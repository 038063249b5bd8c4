//! The mutable state of a session: its belief and its last answers, who may use them, and the
//! memory that they take.
//!
//! The requests of a session take turns at its state, and few may wait. Without the limit,
//! robots that all touch in one session could take every request slot of the server, and
//! requests of other sessions would be refused. One request of each client may always wait, so
//! that those who read a session cannot refuse its robot.

use std::collections::{HashMap, VecDeque};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex as Lock, MutexGuard as Locked, PoisonError};

use palpate_schemas as wire;
use tokio::sync::{Mutex, MutexGuard};

use super::LiveError;
use super::folding::Memory;
use crate::asker::Asker;
use crate::client::Client;

/// Number of answers remembered for repeated readings.
const ANSWERS_MAX: usize = 64;
/// Number of requests that wait for their turn at one session, above which a client may have
/// only one.
const WAITING_MAX: usize = 32;

/// What one request at a time uses: the belief, and answers for repeated requests.
#[derive(Default)]
pub(super) struct State {
    pub(super) memory: Memory,
    /// Beliefs that were answered to readings, by their revisions, newest last.
    answers: VecDeque<wire::Belief>,
}

impl State {
    pub(super) fn bytes(&self) -> usize {
        self.memory.bytes() + self.answers.iter().map(belief_bytes).sum::<usize>()
    }

    pub(super) fn remembered(&self, revision: u64) -> Option<wire::Belief> {
        let answers = self.answers.iter().rev();
        answers.into_iter().find(|belief| u64::from(belief.revision) == revision).cloned()
    }

    pub(super) fn remember(&mut self, belief: &wire::Belief) {
        if self.answers.len() == ANSWERS_MAX {
            self.answers.pop_front();
        }
        self.answers.push_back(belief.clone());
    }
}

/// A value that one request at a time uses.
#[derive(Default)]
pub(super) struct Turns<T> {
    state: Mutex<T>,
    /// Number of waiting requests of each client that has any.
    waiting: Lock<HashMap<Option<Client>, usize>>,
}

/// A place among the requests that wait.
struct Place<'a, T> {
    turns: &'a Turns<T>,
    client: Option<Client>,
}

impl<T> Drop for Place<'_, T> {
    fn drop(&mut self) {
        let mut waiting = self.turns.waiting();
        if let Some(n) = waiting.get_mut(&self.client) {
            *n -= 1;
            if *n == 0 {
                waiting.remove(&self.client);
            }
        }
    }
}

impl<T> Turns<T> {
    /// Waits for a turn, if there is a waiting place.
    pub(super) async fn take(&self) -> Result<MutexGuard<'_, T>, LiveError> {
        let _place = self.place(Asker::current().client())?;
        Ok(self.state.lock().await)
    }

    fn place(&self, client: Option<Client>) -> Result<Place<'_, T>, LiveError> {
        let mut waiting = self.waiting();
        let total: usize = waiting.values().sum();
        let own = waiting.entry(client).or_default();
        if total >= WAITING_MAX && *own > 0 {
            return Err(LiveError::Busy { waiting: total });
        }
        *own += 1;
        Ok(Place { turns: self, client })
    }

    fn waiting(&self) -> Locked<'_, HashMap<Option<Client>, usize>> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for a turn without a limit, for work that must be done, such as ending the session.
    pub(super) async fn insist(&self) -> MutexGuard<'_, T> {
        self.state.lock().await
    }

    /// A turn, if no other request has it.
    pub(super) fn try_take(&self) -> Option<MutexGuard<'_, T>> {
        self.state.try_lock().ok()
    }
}

/// The bytes of all beliefs in memory.
#[derive(Clone, Debug, Default)]
pub(crate) struct Total(Arc<AtomicUsize>);

/// One session's share of the total, released on drop.
#[derive(Debug)]
pub(super) struct Account {
    total: Total,
    bytes: AtomicUsize,
}

impl Total {
    pub(crate) fn bytes(&self) -> usize {
        self.0.load(Ordering::Relaxed)
    }

    pub(super) fn open(&self, bytes: usize) -> Account {
        let account = Account { total: self.clone(), bytes: AtomicUsize::new(0) };
        account.set(bytes);
        account
    }
}

impl Account {
    /// Sets the number of bytes. Not for concurrent calls.
    pub(super) fn set(&self, bytes: usize) {
        let before = self.bytes.swap(bytes, Ordering::Relaxed);
        if bytes >= before {
            self.total.0.fetch_add(bytes - before, Ordering::Relaxed);
        } else {
            self.total.0.fetch_sub(before - bytes, Ordering::Relaxed);
        }
    }
}

impl Drop for Account {
    fn drop(&mut self) {
        self.set(0);
    }
}

/// Approximate memory of a remembered answer.
fn belief_bytes(belief: &wire::Belief) -> usize {
    let objects = belief.objects.iter().map(|object| size_of_val(object) + object.name.len());
    let poses = belief.poses.iter().map(|pose| size_of_val(pose) + pose.name.len() + 36 * 8);
    size_of::<wire::Belief>() + objects.sum::<usize>() + poses.sum::<usize>()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;

    #[tokio::test]
    async fn few_requests_wait_and_all_get_their_turn() {
        let turns = Arc::new(Turns::<u32>::default());
        let first = turns.take().await.unwrap();
        let waiting: Vec<_> = (0..WAITING_MAX)
            .map(|_| {
                let turns = Arc::clone(&turns);
                tokio::spawn(async move { *turns.take().await.unwrap() += 1 })
            })
            .collect();
        let n_waiting = || turns.waiting().values().sum::<usize>();
        while n_waiting() < WAITING_MAX {
            tokio::task::yield_now().await;
        }
        let refused = turns.take().await.map(|_| ());
        assert!(matches!(refused, Err(LiveError::Busy { waiting: WAITING_MAX })));
        let other = Some(Client::Key(uuid::Uuid::nil()));
        let place = turns.place(other).unwrap();
        assert!(turns.place(other).is_err(), "one request of each other client");
        drop(place);
        drop(first);
        for one in waiting {
            one.await.unwrap();
        }
        assert_eq!(*turns.take().await.unwrap(), WAITING_MAX as u32);
        assert_eq!(n_waiting(), 0);
    }

    #[test]
    fn the_total_is_the_sum_of_all_accounts() {
        let total = Total::default();
        let (a, b) = (total.open(10), total.open(5));
        a.set(7);
        assert_eq!(total.bytes(), 12);
        b.set(50);
        drop(a);
        assert_eq!(total.bytes(), 50);
        drop(b);
        assert_eq!(total.bytes(), 0);
    }
}
