//! Running time: how long servers have run on a store, and what their clock showed meanwhile.
//!
//! What cannot be undone, such as the deletion of a session, must not follow from a clock that
//! jumped. Ages are therefore measured in running time: the age of a stamp is the time for which
//! servers ran since their clock last showed that stamp or an earlier one. It is at most the true
//! age, whatever the clock does, and also after restarts and restores. While the clock is behind a
//! stamp, that has no age. Servers that share a store share its running time. Not here: reading the
//! clock (the server).

use std::time::Instant;

use crate::envelope::Kind;
use crate::error::RecordError;
use crate::record::{Record, read, write};

/// Deviation of the clock from the running time up to which it did not jump, ms. Chosen: stops of a
/// process and leap seconds are shorter.
const STEADY_MS: i64 = 1000;
/// Number of jumps, restarts included, that are told apart. Chosen: 2 kB.
const MARKS_MAX: usize = 128;

/// A jump: what the clock showed from a running time on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Mark {
    ran_ms: u64,
    clock_ms: i64,
}

impl Mark {
    /// What the clock shows beyond the running time.
    fn ahead_ms(self) -> i64 {
        self.clock_ms.saturating_sub_unsigned(self.ran_ms)
    }
}

/// The running time at one moment.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Running {
    ran_ms: u64,
    /// Oldest first.
    marks: Vec<Mark>,
}

impl Running {
    /// The running time of a server whose clock started at 0 and never jumped.
    #[must_use]
    pub fn steady(ran_ms: u64) -> Self {
        Self { ran_ms, marks: vec![Mark { ran_ms: 0, clock_ms: 0 }] }
    }

    /// Time for which servers have run, ms.
    #[must_use]
    pub fn now_ms(&self) -> u64 {
        self.ran_ms
    }

    /// The running time at which the clock last showed a stamp (ms since 1970) or an earlier time.
    #[must_use]
    pub fn at(&self, stamp_ms: u64) -> u64 {
        let mut end = self.ran_ms;
        for mark in self.marks.iter().rev() {
            let since = i64::try_from(stamp_ms).unwrap_or(i64::MAX).saturating_sub(mark.clock_ms);
            if let Ok(since) = u64::try_from(since) {
                return end.min(mark.ran_ms.saturating_add(since));
            }
            end = mark.ran_ms;
        }
        0
    }

    /// Notes what the clock shows now (ms since 1970).
    fn see(&mut self, clock_ms: u64) {
        let mark =
            Mark { ran_ms: self.ran_ms, clock_ms: i64::try_from(clock_ms).unwrap_or(i64::MAX) };
        let is_steady =
            |last: &Mark| last.ahead_ms().abs_diff(mark.ahead_ms()) <= STEADY_MS.unsigned_abs();
        if !self.marks.last().is_some_and(is_steady) {
            self.marks.push(mark);
            self.shorten();
        }
    }

    /// Takes over what another server noted.
    fn meet(&mut self, other: &Self) {
        self.ran_ms = self.ran_ms.max(other.ran_ms);
        self.marks.extend(&other.marks);
        self.marks.sort_unstable();
        self.marks.dedup();
        self.shorten();
    }

    /// Joins the two jumps that differ least while there are too many: as the clock that was
    /// behind, which makes stamps younger.
    fn shorten(&mut self) {
        while self.marks.len() > MARKS_MAX {
            let apart = |place: &usize| {
                self.marks[*place].ahead_ms().abs_diff(self.marks[place + 1].ahead_ms())
            };
            let Some(place) = (0..self.marks.len() - 1).min_by_key(apart) else { return };
            let after = self.marks.remove(place + 1);
            let joined = &mut self.marks[place];
            let ahead = joined.ahead_ms().min(after.ahead_ms());
            joined.clock_ms = ahead.saturating_add_unsigned(joined.ran_ms);
        }
    }
}

/// What is stored of the clock.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Clock {
    /// The latest time by which keys expired, milliseconds since 1970.
    pub(crate) latest_ms: u64,
    pub(crate) running: Running,
}

impl Record for Clock {
    const KIND: Kind = Kind::Clock;
    const SCHEMA: u16 = 2;

    fn to_payload(&self) -> Vec<u8> {
        let marks = self.running.marks.iter().map(|mark| (mark.ran_ms, mark.clock_ms));
        write(&(self.latest_ms, self.running.ran_ms, marks.collect::<Vec<_>>()))
    }

    fn from_payload(payload: &[u8]) -> Result<Self, RecordError> {
        let (latest_ms, ran_ms, marks): (u64, u64, Vec<(u64, i64)>) = read(payload)?;
        let marks = marks.into_iter().map(|(ran_ms, clock_ms)| Mark { ran_ms, clock_ms });
        Ok(Self { latest_ms, running: Running { ran_ms, marks: marks.collect() } })
    }

    fn from_older(schema: u16, payload: &[u8]) -> Result<Self, RecordError> {
        match schema {
            // What ended by the clock before there was a running time has ended.
            1 => read(payload)
                .map(|latest_ms| Self { latest_ms, running: Running::steady(latest_ms) }),
            found => Err(RecordError::Schema { found, known: Self::SCHEMA }),
        }
    }
}

/// The running time of a server that runs.
#[derive(Debug)]
pub(crate) struct Runs {
    running: Running,
    /// When `running` was brought up to date, with what is less than a millisecond left over.
    at: Instant,
    /// The last jump that is stored.
    stored: Option<Mark>,
}

impl Runs {
    pub(crate) fn new(running: Running) -> Self {
        let stored = running.marks.last().copied();
        Self { running, at: Instant::now(), stored }
    }

    /// The running time now, when the clock shows `clock_ms`.
    pub(crate) fn now(&mut self, clock_ms: u64, now: Instant) -> &Running {
        let passed = now.saturating_duration_since(self.at);
        let whole =
            std::time::Duration::from_millis(u64::try_from(passed.as_millis()).unwrap_or(u64::MAX));
        self.at += whole;
        self.running.ran_ms += whole.as_millis() as u64;
        self.running.see(clock_ms);
        &self.running
    }

    /// Whether there was a jump that is not stored.
    pub(crate) fn is_news(&self) -> bool {
        self.running.marks.last().copied() != self.stored
    }

    /// Takes over what is stored, and returns what is to be.
    pub(crate) fn meet(&mut self, stored: &Running, clock_ms: u64) -> Running {
        self.running.meet(stored);
        self.now(clock_ms, Instant::now()).clone()
    }

    pub(crate) fn stored(&mut self, running: &Running) {
        self.stored = running.marks.last().copied();
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::record::{decode, encode};

    /// Runs of a second each, with what the clock shows at the end of each.
    fn after(clocks: &[u64]) -> Running {
        let mut runs = Runs::new(Running::default());
        let begin = runs.at;
        for (second, clock_ms) in (0..).zip(clocks) {
            runs.now(*clock_ms, begin + Duration::from_secs(second));
        }
        runs.running
    }

    const DAY: u64 = 86_400_000;

    #[test]
    fn an_age_is_the_time_that_passed_whatever_the_clock_does() {
        let t = 20_000 * DAY;
        let steady = after(&[t, t + 1000, t + 2000, t + 3000]);
        assert_eq!([t, t + 1000, t + 2500, t + DAY].map(|at| steady.at(at)), [0, 1000, 2500, 3000]);
        // Two days ahead for a second: what was before is as old as it is.
        let ahead = after(&[t, t + 1000, t + 2 * DAY, t + 3000, t + 4000]);
        assert_eq!(ahead.at(t + 1000), 1000);
        assert_eq!(ahead.at(t + 2 * DAY), 4000, "a stamp of the future has no age yet");
        // In 1970 until the network tells the time.
        let late = after(&[5, 1005, t, t + 1000]);
        assert_eq!([5, 1005, t].map(|at| late.at(at)), [0, 1000, 2000]);
        // Set back by a year for good: what was stamped before has no age until the clock is there.
        let back = after(&[t, t + 1000, t - 365 * DAY, t - 365 * DAY + 1000]);
        assert_eq!(back.at(t), 3000);
        assert_eq!(back.at(t - 365 * DAY), 2000);
        assert_eq!(back.at(7), 0, "before the first server ran: at least as old as all");
    }

    #[test]
    fn ages_never_exceed_the_truth_when_many_jumps_are_joined() {
        let t = 20_000 * DAY;
        let clocks: Vec<u64> =
            (0..1000).map(|second| t + 1000 * second + DAY * (second * 7919 % 13)).collect();
        let running = after(&clocks);
        assert!(running.marks.len() <= MARKS_MAX);
        for (second, clock) in (0..).zip(&clocks) {
            assert!(running.at(*clock) >= 1000 * second, "{second}: {}", running.at(*clock));
        }
    }

    #[test]
    fn running_time_goes_on_after_a_restart_and_is_shared() {
        let t = 20_000 * DAY;
        let stored = after(&[t, t + 1000]);
        let mut again = Runs::new(stored.clone());
        let begin = again.at;
        let running = again.now(t + 7 * DAY, begin).clone();
        assert_eq!((running.now_ms(), running.at(t + 1000)), (1000, 1000));
        assert_eq!(running.at(t + 3 * DAY), 1000, "nothing ran meanwhile");
        assert!(again.is_news());
        let met = Runs::new(after(&[t])).meet(&stored, t + 1000);
        assert!((1000..2000).contains(&met.now_ms()), "{met:?}");
        assert_eq!(met.at(t), 0);
    }

    #[test]
    fn what_earlier_releases_stored_of_the_clock_is_read() {
        let before = Clock::from_older(1, &write(&7_u64)).unwrap();
        assert_eq!(before, Clock { latest_ms: 7, running: Running::steady(7) });
        let marks =
            vec![Mark { ran_ms: 0, clock_ms: -5 }, Mark { ran_ms: 9, clock_ms: 86_400_000 }];
        let now = Clock { latest_ms: 7, running: Running { ran_ms: 9, marks } };
        let frozen = include_str!("../tests/store/golden/clock_v2.txt");
        let bytes = encode(&now);
        let hex: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
        assert_eq!(hex, frozen.trim_end());
        assert_eq!(decode::<Clock>(&bytes).unwrap(), now);
    }
}
