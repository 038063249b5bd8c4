//! Pauses between attempts: growing, and spread so that receivers that come back are not hit by
//! everything at once.

use std::time::Duration;

use uuid::Uuid;

/// Largest share by which a pause is longer than stated. Chosen: spreads an hour over 12 minutes.
const SPREAD: f64 = 0.2;
/// Longest pause that a receiver can ask for (`Retry-After`).
const ASKED_MAX: Duration = Duration::from_secs(86_400);

/// The pause after the `n_failed`-th failure; `None` when no attempt follows. A receiver may ask
/// for a longer one.
pub(super) fn pause(
    pauses: &[Duration],
    n_failed: u32,
    event: Uuid,
    asked: Option<Duration>,
) -> Option<Duration> {
    let place = (n_failed as usize).checked_sub(1)?;
    let pause = pauses.get(place)?.mul_f64(1.0 + SPREAD * share(event, n_failed));
    Some(asked.map_or(pause, |asked| pause.max(asked.min(ASKED_MAX))))
}

/// A number from 0 to 1 that differs from event to event and from attempt to attempt.
fn share(event: Uuid, n_failed: u32) -> f64 {
    let mut hasher = blake3::Hasher::new();
    hasher.update(event.as_bytes()).update(&n_failed.to_le_bytes());
    let [a, b, ..] = *hasher.finalize().as_bytes();
    f64::from(u16::from_le_bytes([a, b])) / f64::from(u16::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pauses_grow_are_spread_and_end() {
        let pauses = [5, 30, 120].map(Duration::from_secs);
        let mut first = Vec::new();
        for event in (1..100).map(Uuid::from_u128) {
            for (n_failed, stated) in (1..).zip(pauses) {
                let found = pause(&pauses, n_failed, event, None).unwrap();
                assert!((stated..=stated.mul_f64(1.2)).contains(&found), "{found:?}");
                assert_eq!(pause(&pauses, n_failed, event, None), Some(found));
            }
            assert_eq!(pause(&pauses, 4, event, None), None);
            assert_eq!(pause(&pauses, 4, event, Some(Duration::from_secs(1))), None);
            first.push(pause(&pauses, 1, event, None).unwrap());
        }
        first.sort();
        first.dedup();
        assert!(first.len() > 90, "{} different pauses", first.len());
    }

    #[test]
    fn a_receiver_may_ask_for_a_longer_pause_within_a_day() {
        let (pauses, event) = ([Duration::from_secs(5)], Uuid::from_u128(1));
        let asked = |s| pause(&pauses, 1, event, Some(Duration::from_secs(s))).unwrap();
        assert!(asked(1) < Duration::from_secs(7));
        assert_eq!(asked(60), Duration::from_secs(60));
        assert_eq!(asked(1_000_000), ASKED_MAX);
    }
}
