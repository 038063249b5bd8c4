//! Ending a computation whose answer nobody waits for any more.
//!
//! Loops that may take long call [`Stop::check`]: once stopping was asked for it unwinds, without
//! a message, up to [`Stop::heeding`]. What was being changed then is of no use any more.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Whether a computation is to end. Clones are one and the same.
#[derive(Clone, Debug, Default)]
pub struct Stop(Option<Arc<AtomicBool>>);

/// A computation ended before its answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stopped;

impl Stop {
    /// One that is never asked for.
    #[must_use]
    pub fn never() -> Self {
        Self(None)
    }

    /// One that can be asked for.
    #[must_use]
    pub fn possible() -> Self {
        Self(Some(Arc::default()))
    }

    /// Asks every computation that heeds it to end.
    pub fn ask(&self) {
        if let Some(asked) = &self.0 {
            asked.store(true, Ordering::Relaxed);
        }
    }

    /// Whether it was asked for.
    #[must_use]
    pub fn is_asked(&self) -> bool {
        self.0.as_ref().is_some_and(|asked| asked.load(Ordering::Relaxed))
    }

    /// Unwinds when it was asked for; cheap enough for loops of a microsecond.
    pub fn check(&self) {
        if self.is_asked() {
            resume_unwind(Box::new(Stopped));
        }
    }

    /// Does work that calls [`Stop::check`], on this thread or on those that it shares with.
    ///
    /// # Errors
    /// [`Stopped`] when the work ended before its answer. Another panic goes on.
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
    fn parallel_work_ends_when_it_is_asked_to() {
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
