//! The order of computations: clients take turns.
//!
//! The work of one client is done in the order of its arrival.

use std::collections::{HashMap, VecDeque};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::urgency::Size;
use crate::client::Client;

/// A piece of work.
pub(super) struct Piece {
    pub(super) size: Size,
    pub(super) work: Box<dyn FnOnce() + Send>,
}

/// Waiting work.
pub(super) struct Queue {
    state: Mutex<State>,
    came: Condvar,
}

#[derive(Default)]
struct State {
    /// The clients with work, the next one first.
    turns: VecDeque<Option<Client>>,
    work: HashMap<Option<Client>, VecDeque<Piece>>,
    /// Time at which the last piece started while others waited, or the first of these arrived.
    waiting_since: Option<Instant>,
    is_closed: bool,
}

impl State {
    fn push(&mut self, client: Option<Client>, piece: Piece) {
        self.waiting_since.get_or_insert_with(Instant::now);
        let own = self.work.entry(client).or_default();
        if own.is_empty() {
            self.turns.push_back(client);
        }
        own.push_back(piece);
    }

    fn pop(&mut self) -> Option<Piece> {
        let client = self.turns.pop_front()?;
        let own = self.work.get_mut(&client)?;
        let next = own.pop_front();
        if own.is_empty() {
            self.work.remove(&client);
        } else {
            self.turns.push_back(client);
        }
        self.waiting_since = (!self.turns.is_empty()).then(Instant::now);
        next
    }
}

impl Queue {
    pub(super) fn new() -> Self {
        Self { state: Mutex::default(), came: Condvar::new() }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn push(&self, client: Option<Client>, piece: Piece) {
        self.lock().push(client, piece);
        self.came.notify_one();
    }

    /// Waits for the next piece; `None` when the queue is closed and empty.
    pub(super) fn take(&self) -> Option<Piece> {
        let mut state = self.lock();
        loop {
            if let Some(work) = state.pop() {
                return Some(work);
            }
            if state.is_closed {
                return None;
            }
            state = self.came.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Releases waiting threads after the last piece.
    pub(super) fn close(&self) {
        self.lock().is_closed = true;
        self.came.notify_all();
    }

    /// Time for which work has been waiting without any being taken.
    pub(super) fn stalled(&self) -> Duration {
        self.lock().waiting_since.map_or(Duration::ZERO, |since| since.elapsed())
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;

    fn piece(work: impl FnOnce() + Send + 'static) -> Piece {
        Piece { size: Size::Small, work: Box::new(work) }
    }

    #[test]
    fn clients_take_turns() {
        let (queue, done) = (Queue::new(), Arc::new(Mutex::new(Vec::new())));
        for (client, name) in [(1, "a1"), (1, "a2"), (1, "a3"), (2, "b1")] {
            let done = Arc::clone(&done);
            let client = Some(Client::at([10, 0, 0, client].into()));
            queue.push(client, piece(move || done.lock().unwrap().push(name)));
        }
        queue.close();
        while let Some(piece) = queue.take() {
            (piece.work)();
        }
        assert_eq!(*done.lock().unwrap(), ["a1", "b1", "a2", "a3"]);
    }

    #[test]
    fn stalled_work_is_detected() {
        let queue = Queue::new();
        assert_eq!(queue.stalled(), Duration::ZERO);
        queue.push(None, piece(|| ()));
        std::thread::sleep(Duration::from_millis(20));
        assert!(queue.stalled() >= Duration::from_millis(20));
        assert!(queue.take().is_some());
        assert_eq!(queue.stalled(), Duration::ZERO);
    }
}
