//! The clock in the database: the running time, and the latest time by which keys expired.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use super::Database;
use crate::engine::{Commit, Engine, Expected};
use crate::error::{StoreError, conflict};
use crate::key::{self, Space};
use crate::record;
use crate::running::{Clock, Running, Runs};

impl Database {
    /// The database whose running time begins with what is stored of it. A clock that cannot be
    /// read is an error for those who need its time.
    pub(super) fn running_from(engine: Arc<dyn Engine>) -> Self {
        let stored = stored_clock(&*engine).map(|(_, clock)| clock.running).unwrap_or_default();
        Self { engine, runs: Arc::new(Mutex::new(Runs::new(stored))) }
    }

    /// The latest stored time, milliseconds since 1970; 0 when there is none.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] and the engine's.
    pub fn latest_time(&self) -> Result<u64, StoreError> {
        Ok(stored_clock(&*self.engine)?.1.latest_ms)
    }

    /// The running time now, when the machine's clock shows `clock_ms` (since 1970).
    #[must_use]
    pub fn running(&self, clock_ms: u64) -> Running {
        self.runs().now(clock_ms, Instant::now()).clone()
    }

    /// Whether the clock jumped since its state was stored.
    #[must_use]
    pub fn clock_jumped(&self, clock_ms: u64) -> bool {
        let mut runs = self.runs();
        runs.now(clock_ms, Instant::now());
        runs.is_news()
    }

    /// Stores the running time, and the latest time unless a later one is stored; durable when it
    /// returns the later one. Takes over what other servers stored.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] and the engine's.
    pub async fn store_clock(&self, latest_ms: u64, clock_ms: u64) -> Result<u64, StoreError> {
        let head = key::space(Space::Clock);
        loop {
            let (before, stored) = stored_clock(&*self.engine)?;
            let running = self.runs().meet(&stored.running, clock_ms);
            let clock = Clock { latest_ms: latest_ms.max(stored.latest_ms), running };
            let expected = before.map_or(Expected::Absent, Expected::Value);
            let commit = Commit::new().expect(head.clone(), expected);
            let commit = commit.put(head.clone(), record::encode(&clock));
            match self.engine.commit(commit).await.map_err(conflict) {
                Ok(()) => {
                    self.runs().stored(&clock.running);
                    return Ok(clock.latest_ms);
                }
                // Another server stored its own.
                Err(Ok(_)) => {}
                Err(Err(error)) => return Err(error.into()),
            }
        }
    }

    fn runs(&self) -> MutexGuard<'_, Runs> {
        self.runs.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The stored state of the clock, with its bytes.
fn stored_clock(engine: &dyn Engine) -> Result<(Option<Vec<u8>>, Clock), StoreError> {
    let Some(bytes) = engine.get(&key::space(Space::Clock))? else {
        return Ok((None, Clock::default()));
    };
    let clock = record::decode(&bytes).map_err(StoreError::damaged(Space::Clock))?;
    Ok((Some(bytes), clock))
}
