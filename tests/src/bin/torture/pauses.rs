//! The longest time in which a service acknowledged nothing.

use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// The longest time without an acknowledgement to any robot.
pub(crate) struct Pauses(Mutex<(Instant, Duration)>);

impl Pauses {
    /// Nothing is acknowledged yet.
    pub(crate) fn new() -> Self {
        Self(Mutex::new((Instant::now(), Duration::ZERO)))
    }

    /// Notes an acknowledgement.
    pub(crate) fn acknowledged(&self) {
        let mut state = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let now = Instant::now();
        *state = (now, state.1.max(now - state.0));
    }

    /// Begins to count again, after a time in which nobody wrote.
    pub(crate) fn resume(&self) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).0 = Instant::now();
    }

    /// The time of the last acknowledgement.
    pub(crate) fn last(&self) -> Instant {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).0
    }

    /// The longest time so far.
    pub(crate) fn longest(&self) -> Duration {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).1
    }
}
