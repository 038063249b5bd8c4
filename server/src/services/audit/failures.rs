//! Limit on the failing changes of one key: enough for mistakes, too few for an attack.
//!
//! A bucket for each key fills with failures and drains evenly; a key with a full bucket has
//! to wait. Successful changes cost nothing.

use std::collections::HashMap;
use std::num::NonZeroU32;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use uuid::Uuid;

use crate::limits::Bound;

/// Number of remembered keys above which those with empty buckets are forgotten.
const KEYS_REMEMBERED: usize = 1000;
/// The time in which a full bucket drains.
const WINDOW: Duration = Duration::from_secs(60);

/// The buckets of all keys.
#[derive(Debug)]
pub(crate) struct Failures {
    per_minute: NonZeroU32,
    buckets: Mutex<HashMap<Uuid, Bucket>>,
}

#[derive(Clone, Copy, Debug)]
struct Bucket {
    level: f64,
    at: Instant,
}

impl Failures {
    pub(crate) fn new(per_minute: NonZeroU32) -> Self {
        Self { per_minute, buckets: Mutex::default() }
    }

    /// Whether a key may try another change; if not, the time it has to wait.
    pub(crate) fn check(&self, key: Uuid, now: Instant) -> Result<(), Duration> {
        let level = self.buckets().get(&key).map_or(0.0, |bucket| self.level(*bucket, now));
        let above = level + 1.0 - f64::from(self.per_minute.get());
        if above > 0.0 { Err(WINDOW.mul_f64(above / self.drain())) } else { Ok(()) }
    }

    /// Notes that a change of a key failed.
    pub(crate) fn failed(&self, key: Uuid, now: Instant) {
        let mut buckets = self.buckets();
        if buckets.len() >= KEYS_REMEMBERED {
            buckets.retain(|_, bucket| self.level(*bucket, now) > 0.0);
        }
        let bucket = buckets.entry(key).or_insert(Bucket { level: 0.0, at: now });
        *bucket = Bucket { level: self.level(*bucket, now) + 1.0, at: now };
    }

    /// The limit, as reported to a key that has to wait.
    pub(crate) fn bound(&self, wait: Duration) -> Bound {
        Bound {
            name: "failed-changes",
            unit: "requests",
            limit: u64::from(self.per_minute.get()),
            window: Some(WINDOW),
            left: 0,
            reset: wait,
        }
    }

    fn level(&self, bucket: Bucket, now: Instant) -> f64 {
        let elapsed = now.saturating_duration_since(bucket.at).as_secs_f64();
        (bucket.level - elapsed * self.drain() / WINDOW.as_secs_f64()).max(0.0)
    }

    /// Amount drained within [`WINDOW`].
    fn drain(&self) -> f64 {
        f64::from(self.per_minute.get())
    }

    fn buckets(&self) -> MutexGuard<'_, HashMap<Uuid, Bucket>> {
        self.buckets.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_key_with_too_many_failures_waits() {
        let failures = Failures::new(NonZeroU32::new(60).unwrap());
        let (now, [a, b]) = (Instant::now(), [1, 2].map(Uuid::from_u128));
        for _ in 0..60 {
            assert_eq!(failures.check(a, now), Ok(()));
            failures.failed(a, now);
        }
        // 60 a minute drain: there is room for one more after a second.
        assert_eq!(failures.check(a, now), Err(Duration::from_secs(1)));
        assert_eq!(failures.check(b, now), Ok(()));
        let later = now + Duration::from_secs(1);
        assert_eq!(failures.check(a, later), Ok(()));
        failures.failed(a, later);
        assert_eq!(failures.check(a, later), Err(Duration::from_secs(1)));
    }
}
