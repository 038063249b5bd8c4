//! Stamps of a robot's readings by this computer's clock. They always increase, even if the clock
//! does not, and a repeated reading keeps its stamp.

use std::time::{Duration, SystemTime};

use palpate_schemas::Stamp;

/// Stamps of one robot.
#[derive(Clone, Debug, Default)]
pub(crate) struct Stamps {
    /// The newest stamp since 1970, and the number of its reading.
    newest: Duration,
    given_to: Option<u64>,
}

impl Stamps {
    /// Stamp of the reading with a number.
    pub(crate) fn of(&mut self, seq: u64) -> Stamp {
        // A clock before 1970 counts as 1970; the stamps still increase.
        let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
        self.at(seq, now.unwrap_or_default())
    }

    /// Stamp of the reading with a number, given the time since 1970.
    fn at(&mut self, seq: u64, now: Duration) -> Stamp {
        if self.given_to != Some(seq) {
            self.newest = now.max(self.newest + Duration::from_nanos(1));
            self.given_to = Some(seq);
        }
        Stamp { sec: self.newest.as_secs(), nanosec: self.newest.subsec_nanos() }
    }

    /// Drops the newest stamp because its reading was not stored and its number will be reused.
    pub(crate) fn forget(&mut self) {
        self.given_to = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_rise_though_the_clock_is_set_back() {
        let mut stamps = Stamps::default();
        let secs = Duration::from_secs;
        assert_eq!(stamps.at(0, secs(100)), Stamp { sec: 100, nanosec: 0 });
        assert_eq!(stamps.at(1, secs(40)), Stamp { sec: 100, nanosec: 1 });
        assert_eq!(stamps.at(2, secs(100)), Stamp { sec: 100, nanosec: 2 });
        assert_eq!(stamps.at(3, secs(101)), Stamp { sec: 101, nanosec: 0 });
    }

    #[test]
    fn a_repeated_reading_keeps_its_stamp_and_a_new_one_differs() {
        let mut stamps = Stamps::default();
        let first = stamps.at(7, Duration::from_secs(100));
        assert_eq!(stamps.at(7, Duration::from_secs(160)), first);
        stamps.forget();
        assert_eq!(stamps.at(7, Duration::from_secs(160)).sec, 160);
    }
}
