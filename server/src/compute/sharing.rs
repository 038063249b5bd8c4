//! Threads to which large pieces of work are shared out, one piece at a time.

use std::io;
use std::sync::{Arc, Mutex, PoisonError};

use rayon::{ThreadPool, ThreadPoolBuilder};

use super::urgency::{Thread, Urgency};

/// Threads that help one piece at a time.
pub(super) struct Sharing {
    pub(super) pool: ThreadPool,
    pub(super) helpers: Helpers,
}

/// The threads of a [`Sharing`] that have started.
#[derive(Clone, Default)]
pub(super) struct Helpers(Arc<Mutex<Vec<Thread>>>);

impl Helpers {
    /// Sets the priority of all.
    pub(super) fn give_way(&self, more: i32) {
        let threads = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        threads.iter().for_each(|thread| thread.give_way(more));
    }
}

impl Sharing {
    /// Starts `n` threads.
    pub(super) fn start(n: usize, urgency: Urgency) -> io::Result<Self> {
        let helpers = Helpers::default();
        let started = helpers.clone();
        let pool = ThreadPoolBuilder::new()
            .num_threads(n)
            .thread_name(move |thread| format!("{}-share-{thread}", urgency.threads()))
            .start_handler(move |_| {
                let thread = Thread::current();
                thread.give_way(urgency.nice());
                started.0.lock().unwrap_or_else(PoisonError::into_inner).push(thread);
            })
            .build()
            .map_err(io::Error::other)?;
        Ok(Self { pool, helpers })
    }
}
