//! The order in which work is computed: clients take turns, and short work goes before long.
//!
//! The work of one client is done in the order in which it came. Long work, such as a slice of an
//! explanation, gives way to short work such as a reading, but not without end: when both wait
//! every fourth piece is a long one.

use std::collections::{HashMap, VecDeque};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use crate::client::Client;

/// A piece of work.
pub(super) type Work = Box<dyn FnOnce() + Send>;

/// When both wait, one piece of this many is a long one. Chosen: an explanation alone with many
/// robots still ends, and readings lose a quarter of the threads at most.
const LONG_EVERY: u32 = 4;

/// Whether work gives way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Length {
    /// A robot waits for it.
    Short,
    /// It gives way to short work.
    Long,
}

/// Work that waits for a thread.
pub(super) struct Queue {
    state: Mutex<State>,
    came: Condvar,
}

#[derive(Default)]
struct State {
    short: Lane,
    long: Lane,
    /// Pieces of short work since the last long one that was waiting.
    short_in_a_row: u32,
    /// When the last piece began while others waited, or the first of these came.
    waiting_since: Option<Instant>,
    is_closed: bool,
}

/// Work of one length.
#[derive(Default)]
struct Lane {
    /// The clients with work, the next one first.
    turns: VecDeque<Option<Client>>,
    work: HashMap<Option<Client>, VecDeque<Work>>,
}

impl Lane {
    fn push(&mut self, client: Option<Client>, work: Work) {
        let own = self.work.entry(client).or_default();
        if own.is_empty() {
            self.turns.push_back(client);
        }
        own.push_back(work);
    }

    fn pop(&mut self) -> Option<Work> {
        let client = self.turns.pop_front()?;
        let own = self.work.get_mut(&client)?;
        let next = own.pop_front();
        if own.is_empty() {
            self.work.remove(&client);
        } else {
            self.turns.push_back(client);
        }
        next
    }

    fn is_empty(&self) -> bool {
        self.turns.is_empty()
    }
}

impl State {
    fn is_empty(&self) -> bool {
        self.short.is_empty() && self.long.is_empty()
    }

    fn pop(&mut self) -> Option<Work> {
        let long_is_due = self.short_in_a_row + 1 >= LONG_EVERY || self.short.is_empty();
        let next = if !self.long.is_empty() && long_is_due {
            self.short_in_a_row = 0;
            self.long.pop()
        } else {
            self.short_in_a_row += u32::from(!self.long.is_empty());
            self.short.pop()
        };
        self.waiting_since = (!self.is_empty()).then(Instant::now);
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

    pub(super) fn push(&self, client: Option<Client>, length: Length, work: Work) {
        let mut state = self.lock();
        state.waiting_since.get_or_insert_with(Instant::now);
        match length {
            Length::Short => state.short.push(client, work),
            Length::Long => state.long.push(client, work),
        }
        self.came.notify_one();
    }

    /// Waits for the next piece; `None` when the queue is closed and empty.
    pub(super) fn take(&self) -> Option<Work> {
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

    /// Lets those who wait go when the last piece is done.
    pub(super) fn close(&self) {
        self.lock().is_closed = true;
        self.came.notify_all();
    }

    /// How long work has been waiting without a thread that takes any.
    pub(super) fn stalled(&self) -> Duration {
        self.lock().waiting_since.map_or(Duration::ZERO, |since| since.elapsed())
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;

    /// The names of pieces in the order in which they are computed.
    fn order(pieces: &[(u8, Length, &'static str)]) -> Vec<&'static str> {
        let (queue, done) = (Queue::new(), Arc::new(Mutex::new(Vec::new())));
        for (client, length, name) in pieces {
            let (done, name) = (Arc::clone(&done), *name);
            let client = Some(Client::at([10, 0, 0, *client].into()));
            queue.push(client, *length, Box::new(move || done.lock().unwrap().push(name)));
        }
        queue.close();
        while let Some(work) = queue.take() {
            work();
        }
        drop(queue);
        Arc::into_inner(done).unwrap().into_inner().unwrap()
    }

    #[test]
    fn clients_take_turns() {
        use Length::Short;
        let pieces = [(1, Short, "a1"), (1, Short, "a2"), (1, Short, "a3"), (2, Short, "b1")];
        assert_eq!(order(&pieces), ["a1", "b1", "a2", "a3"]);
    }

    #[test]
    fn long_work_gives_way_and_is_done_all_the_same() {
        use Length::{Long, Short};
        let mut pieces = vec![(1, Long, "l1"), (1, Long, "l2")];
        pieces.extend([(2, Short, "s"); 7]);
        assert_eq!(order(&pieces), ["s", "s", "s", "l1", "s", "s", "s", "l2", "s"]);
    }

    #[test]
    fn work_that_no_thread_takes_is_noticed() {
        let queue = Queue::new();
        assert_eq!(queue.stalled(), Duration::ZERO);
        queue.push(None, Length::Short, Box::new(|| ()));
        std::thread::sleep(Duration::from_millis(20));
        assert!(queue.stalled() >= Duration::from_millis(20));
        assert!(queue.take().is_some());
        assert_eq!(queue.stalled(), Duration::ZERO);
    }
}
