//! Cancellation of a computation whose result is no longer needed.
//!
//! Long loops call [`Stop::check`]: once a stop was requested it unwinds, without a message,
//! up to [`Stop::heeding`]. The values under change at that moment must be discarded.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A request to end a computation. Clones share it.
#[derive(Clone, Debug, Default)]
pub struct Stop(Option<Arc<AtomicBool>>);

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

    /// Requests the end of every computation that checks it.
    pub fn ask(&self) {
        if let Some(asked) = &self.0 {
            asked.store(true, Ordering::Relaxed);
        }
    }

    /// Whether it was requested.
    #[must_use]
    pub fn is_asked(&self) -> bool {
        self.0.as_ref().is_some_and(|asked| asked.load(Ordering::Relaxed))
    }

    /// Unwinds when it was requested; cheap enough for loops of a microsecond.
    pub fn check(&self) {
        if self.is_asked() {
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
}
