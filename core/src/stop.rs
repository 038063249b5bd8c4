//! Cancellation of a computation whose result is no longer needed, and pauses of one that others
//! wait for.
//!
//! Long loops call [`Stop::check`]: once a stop was requested it unwinds, without a message,
//! up to [`Stop::heeding`]. The values under change at that moment must be discarded. While a
//! computation is held, the same call waits.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError};

/// A request to end a computation. Clones share it.
#[derive(Clone, Debug, Default)]
pub struct Stop(Option<Arc<Orders>>);

#[derive(Debug, Default)]
struct Orders {
    is_asked: AtomicBool,
    is_held: AtomicBool,
    n_waiting: AtomicUsize,
    /// Taken to change an order that waiting threads must hear of.
    changing: Mutex<()>,
    changed: Condvar,
}

impl Orders {
    fn set(&self, order: &AtomicBool, to: bool) {
        if order.load(Ordering::Relaxed) == to {
            return;
        }
        let _changing = self.changing.lock().unwrap_or_else(PoisonError::into_inner);
        order.store(to, Ordering::Relaxed);
        self.changed.notify_all();
    }

    fn wait(&self) {
        let mut changing = self.changing.lock().unwrap_or_else(PoisonError::into_inner);
        self.n_waiting.fetch_add(1, Ordering::Relaxed);
        while self.is_held.load(Ordering::Relaxed) && !self.is_asked.load(Ordering::Relaxed) {
            changing = self.changed.wait(changing).unwrap_or_else(PoisonError::into_inner);
        }
        self.n_waiting.fetch_sub(1, Ordering::Relaxed);
    }
}

/// A computation ended before its result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stopped;

impl Stop {
    /// A stop that is never requested.
    #[must_use]
    pub fn never() -> Self {
        Self(None)
    }

    /// A stop that can be requested.
    #[must_use]
    pub fn possible() -> Self {
        Self(Some(Arc::default()))
    }

    /// Requests the end of every computation that checks it, held or not.
    pub fn ask(&self) {
        if let Some(orders) = &self.0 {
            orders.set(&orders.is_asked, true);
        }
    }

    /// Makes every computation that checks it wait until [`Stop::release`].
    pub fn hold(&self) {
        if let Some(orders) = &self.0 {
            orders.set(&orders.is_held, true);
        }
    }

    /// Ends [`Stop::hold`].
    pub fn release(&self) {
        if let Some(orders) = &self.0 {
            orders.set(&orders.is_held, false);
        }
    }

    /// Whether it is held.
    #[must_use]
    pub fn is_held(&self) -> bool {
        self.0.as_ref().is_some_and(|orders| orders.is_held.load(Ordering::Relaxed))
    }

    /// Whether a computation has reached a check and waits there.
    #[must_use]
    pub fn is_waiting(&self) -> bool {
        self.0.as_ref().is_some_and(|orders| orders.n_waiting.load(Ordering::Relaxed) > 0)
    }

    /// Whether it was requested.
    #[must_use]
    pub fn is_asked(&self) -> bool {
        self.0.as_ref().is_some_and(|orders| orders.is_asked.load(Ordering::Relaxed))
    }

    /// Waits while it is held, and unwinds when it was requested; cheap enough for loops of a
    /// microsecond.
    pub fn check(&self) {
        let Some(orders) = &self.0 else { return };
        if orders.is_held.load(Ordering::Relaxed) {
            orders.wait();
        }
        if orders.is_asked.load(Ordering::Relaxed) {
            resume_unwind(Box::new(Stopped));
        }
    }

    /// Runs work that calls [`Stop::check`], on this thread or in parallel.
    ///
    /// # Errors
    /// [`Stopped`] when the work ended before its result. Other panics propagate.
    pub fn heeding<T>(work: impl FnOnce() -> T) -> Result<T, Stopped> {
        catch_unwind(AssertUnwindSafe(work)).map_err(|panic| match panic.downcast::<Stopped>() {
            Ok(stopped) => *stopped,
            Err(panic) => resume_unwind(panic),
        })
    }
}

#[cfg(test)]
mod tests {
    use rayon::prelude::*;

    use super::*;

    #[test]
    fn parallel_work_ends_on_request() {
        let stop = Stop::possible();
        let done = Stop::heeding(|| {
            (0..1_000_000_u64).into_par_iter().for_each(|n| {
                stop.check();
                if n == 1000 {
                    stop.ask();
                }
            });
        });
        assert_eq!(done, Err(Stopped));
        assert_eq!(Stop::heeding(|| Stop::never().check()), Ok(()));
    }

    #[test]
    fn held_work_waits_and_can_still_be_ended() {
        for ends in [Stop::release, Stop::ask] {
            let stop = Stop::possible();
            stop.hold();
            let (reached, has_reached) = std::sync::mpsc::channel();
            let held = stop.clone();
            let work = std::thread::spawn(move || {
                let done = Stop::heeding(|| held.check());
                reached.send(()).unwrap();
                done
            });
            assert!(has_reached.recv_timeout(std::time::Duration::from_millis(20)).is_err());
            ends(&stop);
            has_reached.recv().unwrap();
            assert_eq!(work.join().unwrap().is_err(), stop.is_asked());
        }
    }
}
