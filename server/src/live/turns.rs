//! Turns at a session: its requests run one after the other, and few may wait.
//!
//! Without the limit, robots that all touch in one session could take every request slot of
//! the server, and requests of other sessions would be refused.

use tokio::sync::{Mutex, MutexGuard, Semaphore};

use super::error::LiveError;

/// Maximum number of requests that wait for their turn at one session.
const WAITING_MAX: usize = 32;

/// A value that one request at a time uses.
pub(super) struct Turns<T> {
    state: Mutex<T>,
    places: Semaphore,
}

impl<T: Default> Default for Turns<T> {
    fn default() -> Self {
        Self { state: Mutex::default(), places: Semaphore::new(WAITING_MAX) }
    }
}

impl<T> Turns<T> {
    /// Waits for a turn, if there is a waiting slot.
    pub(super) async fn take(&self) -> Result<MutexGuard<'_, T>, LiveError> {
        let _place =
            self.places.try_acquire().map_err(|_| LiveError::Busy { waiting: WAITING_MAX })?;
        Ok(self.state.lock().await)
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
        while turns.places.available_permits() > 0 {
            tokio::task::yield_now().await;
        }
        let refused = turns.take().await.map(|_| ());
        assert!(matches!(refused, Err(LiveError::Busy { waiting: WAITING_MAX })));
        drop(first);
        for one in waiting {
            one.await.unwrap();
        }
        assert_eq!(*turns.take().await.unwrap(), WAITING_MAX as u32);
    }
}
