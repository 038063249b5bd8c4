//! One day of a sensor.

use super::presses::PressSums;
use super::shifts::ShiftSums;

/// What the sessions that ended on one day (UTC) say about a sensor.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Day {
    /// Days since 1970-01-01.
    pub day: u32,
    /// Number of the calibration with which the pressures were corrected; 0 for none.
    pub calibration: u32,
    /// Its presses.
    pub presses: PressSums,
    /// Errors that recognised sessions agree on.
    pub shifts: ShiftSums,
}

impl Day {
    /// Adds the same day's sums of later sessions. Sums under an earlier calibration give way to
    /// those under a later one: its values at rest are others.
    pub fn merge(&mut self, other: &Self) {
        match self.calibration.cmp(&other.calibration) {
            std::cmp::Ordering::Less => self.clone_from(other),
            std::cmp::Ordering::Equal => {
                self.presses.merge(&other.presses);
                self.shifts.merge(&other.shifts);
            }
            std::cmp::Ordering::Greater => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_later_calibration_begins_anew() {
        let day = |calibration, n_presses| Day {
            day: 3,
            calibration,
            presses: PressSums { n_presses, ..PressSums::default() },
            shifts: ShiftSums::default(),
        };
        let mut merged = day(1, 5);
        merged.merge(&day(1, 2));
        assert_eq!(merged, day(1, 7));
        merged.merge(&day(2, 4));
        assert_eq!(merged, day(2, 4));
        merged.merge(&day(1, 9));
        assert_eq!(merged, day(2, 4));
    }
}
