//! The time by which keys expire: it never decreases, even across restarts.
//!
//! It is the later of the machine's clock and the latest earlier time plus the time passed
//! since, by a monotonic clock. It is stored every minute, so a crash loses at most a minute.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use tokio::sync::watch;

use super::Keys;
use crate::clock::{now_ms, pause};

/// Interval at which the latest time is stored.
const STORE_EVERY: Duration = Duration::from_secs(60);

/// The latest time, and the instant of its observation.
#[derive(Debug)]
pub(super) struct Latest(Mutex<(u64, Instant)>);

impl Latest {
    pub(super) fn new(stored_ms: u64) -> Self {
        Self(Mutex::new((stored_ms, Instant::now())))
    }

    /// The latest time, milliseconds since 1970.
    pub(super) fn now_ms(&self) -> u64 {
        self.at(now_ms(), Instant::now())
    }

    /// Takes over a later time, which another server has seen.
    fn raise(&self, latest_ms: u64) {
        let now = Instant::now();
        self.at(latest_ms, now);
    }

    /// The latest time, when the machine's clock shows `clock_ms`.
    fn at(&self, clock_ms: u64, now: Instant) -> u64 {
        let mut latest = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let passed = now.saturating_duration_since(latest.1).as_millis();
        let passed = latest.0.saturating_add(u64::try_from(passed).unwrap_or(u64::MAX));
        if clock_ms > passed {
            *latest = (clock_ms, now);
        }
        clock_ms.max(passed)
    }
}

impl Keys {
    /// The time by which keys expire, milliseconds since 1970.
    pub(crate) fn now_ms(&self) -> u64 {
        self.latest.now_ms()
    }

    /// Stores the latest time periodically, and when the server stops.
    pub(crate) async fn keep_time(self: Arc<Self>, mut stopping: watch::Receiver<bool>) {
        loop {
            let goes_on = pause(STORE_EVERY, &mut stopping).await;
            match self.store.store_latest_time(self.now_ms()).await {
                Ok(latest_ms) => self.latest.raise(latest_ms),
                Err(error) => tracing::warn!(%error, "Cannot store the latest time"),
            }
            if !goes_on {
                return;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_increases_when_the_clock_is_set_back() {
        let begin = Instant::now();
        let latest = Latest(Mutex::new((10_000, begin)));
        let after = |ms| begin + Duration::from_millis(ms);
        assert_eq!(latest.at(2_000, after(0)), 10_000, "set back before the start");
        assert_eq!(latest.at(2_500, after(500)), 10_500);
        assert_eq!(latest.at(20_000, after(600)), 20_000);
        assert_eq!(latest.at(3_000, after(700)), 20_100, "set back while it runs");
    }
}
