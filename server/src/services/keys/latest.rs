//! The time by which keys expire: it never decreases by more than a jump that was undone, even
//! across restarts.
//!
//! It is the later of the machine's clock and the latest settled time plus the time passed since, by
//! a monotonic clock. A clock that jumps ahead expires keys at once, but is settled only when it has
//! been ahead for an hour: one that was wrong for a moment ends no key for good. The settled time
//! is stored every minute, so a crash loses at most a minute.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use palpate_store::error::StoreError;
use tokio::sync::watch;

use super::Keys;
use crate::clock::{now_ms, pause};

/// Interval at which the settled time is stored.
const STORE_EVERY: Duration = Duration::from_secs(60);
/// Interval at which jumps of the clock are looked for, which are stored at once.
const LOOK_EVERY: Duration = Duration::from_secs(1);
/// Time by which a clock that did not jump may be ahead, ms.
const STEADY_MS: u64 = 60_000;
/// Time for which a clock must be ahead to be settled. Chosen: wrong clocks are noticed sooner.
const SETTLES_AFTER: Duration = Duration::from_secs(3600);

/// The latest time.
#[derive(Debug)]
pub(super) struct Latest {
    state: Mutex<State>,
    /// Whether the time is to be stored soon.
    is_wanted: AtomicBool,
}

#[derive(Debug)]
struct State {
    /// The settled time, and the instant of its observation.
    settled: (u64, Instant),
    /// Since when the clock is ahead of it.
    ahead_since: Option<Instant>,
}

impl Latest {
    /// After the settled time that was stored; 0 for none.
    pub(super) fn new(stored_ms: u64) -> Self {
        let begin_ms = if stored_ms == 0 { now_ms() } else { stored_ms };
        Self::of((begin_ms, Instant::now()))
    }

    fn of(settled: (u64, Instant)) -> Self {
        let state = Mutex::new(State { settled, ahead_since: None });
        Self { state, is_wanted: AtomicBool::new(false) }
    }

    /// The latest time, milliseconds since 1970.
    pub(super) fn now_ms(&self) -> u64 {
        self.at(now_ms(), Instant::now()).0
    }

    /// Takes over a later settled time, which another server has stored.
    fn raise(&self, settled_ms: u64) {
        let now = Instant::now();
        if self.at(0, now).1 < settled_ms {
            self.state.lock().unwrap_or_else(PoisonError::into_inner).settled = (settled_ms, now);
        }
    }

    /// The latest and the settled time, when the machine's clock shows `clock_ms`.
    fn at(&self, clock_ms: u64, now: Instant) -> (u64, u64) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let passed = now.saturating_duration_since(state.settled.1).as_millis();
        let passed = state.settled.0.saturating_add(u64::try_from(passed).unwrap_or(u64::MAX));
        if clock_ms <= passed {
            // A clock of 0 asks for the settled time.
            state.ahead_since = state.ahead_since.filter(|_| clock_ms == 0);
            return (passed, passed);
        }
        if clock_ms - passed > STEADY_MS {
            let since = *state.ahead_since.get_or_insert(now);
            if now.saturating_duration_since(since) < SETTLES_AFTER {
                return (clock_ms, passed);
            }
        }
        *state = State { settled: (clock_ms, now), ahead_since: None };
        (clock_ms, clock_ms)
    }
}

impl Keys {
    /// The time by which keys expire, milliseconds since 1970.
    pub(crate) fn now_ms(&self) -> u64 {
        self.latest.now_ms()
    }

    /// Stores the settled time and the running time, and takes over what other servers stored.
    pub(crate) async fn store_time(&self) -> Result<(), StoreError> {
        let settled_ms = self.latest.at(now_ms(), Instant::now()).1;
        self.latest.raise(self.store.essential().store_clock(settled_ms, now_ms()).await?);
        Ok(())
    }

    /// Has the time stored soon: something has just ended by its age, and is to stay so after a crash.
    pub(crate) fn want_time(&self) {
        self.latest.is_wanted.store(true, Ordering::Relaxed);
    }

    /// Stores the time periodically, when it is wanted, and after every jump of the clock.
    pub(crate) async fn keep_time(self: Arc<Self>, mut stopping: watch::Receiver<bool>) {
        let mut stored: Option<Instant> = None;
        while pause(LOOK_EVERY, &mut stopping).await {
            let is_due = stored.is_none_or(|at| at.elapsed() >= STORE_EVERY);
            let is_wanted = self.latest.is_wanted.swap(false, Ordering::Relaxed);
            if is_due || is_wanted || self.store.clock_jumped(now_ms()) {
                if let Err(error) = self.store_time().await {
                    tracing::warn!(%error, "Cannot store the time");
                    // What has just ended must stay so.
                    if is_wanted {
                        self.want_time();
                    }
                }
                stored = Some(Instant::now());
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
        let latest = Latest::of((10_000, begin));
        let after = |ms| begin + Duration::from_millis(ms);
        let at = |clock_ms, ms| latest.at(clock_ms, after(ms)).0;
        assert_eq!(at(2_000, 0), 10_000, "set back before the start");
        assert_eq!(at(2_500, 500), 10_500);
        assert_eq!(at(20_000, 600), 20_000);
        assert_eq!(at(3_000, 700), 20_100, "set back while it runs");
    }

    #[test]
    fn a_jump_ahead_expires_keys_for_good_only_after_an_hour() {
        let (begin, day) = (Instant::now(), 86_400_000);
        let latest = Latest::of((day, begin));
        let at = |clock_ms, s| latest.at(clock_ms, begin + Duration::from_secs(s)).0;
        assert_eq!(at(3 * day, 0), 3 * day);
        assert_eq!(at(3 * day + 75_000, 75), 3 * day + 75_000);
        assert_eq!(at(day + 76_000, 76), day + 76_000, "the clock is right again");
        assert_eq!(at(3 * day, 80), 3 * day);
        assert_eq!(at(3 * day + 3_600_000, 3680), 3 * day + 3_600_000);
        assert_eq!(at(day, 3681), 3 * day + 3_601_000, "it was ahead for an hour");
    }
}
