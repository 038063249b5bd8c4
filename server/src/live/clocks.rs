//! The clocks of a session's robots, as far as their readings contradict themselves: a robot's
//! numbers count up, so its stamps must not step back.
//!
//! A function of the readings in folding order, which is by stamp, so that no order of arrival
//! changes it.

use std::collections::BTreeMap;

use palpate_store::entity::ReadingId;

use crate::hints::SetBack;

/// What was seen of the clocks so far.
#[derive(Clone, Debug, Default)]
pub(super) struct Clocks {
    /// The largest number of each robot.
    largest: BTreeMap<String, u64>,
    set_back: Option<SetBack>,
}

impl Clocks {
    /// Takes the next reading in folding order. Those without a stamp or an id contradict nothing.
    pub(super) fn take(&mut self, stamp_ns: Option<i64>, id: Option<&ReadingId>) {
        let (Some(_), Some(ReadingId { robot, seq })) = (stamp_ns, id) else { return };
        match self.largest.get_mut(robot) {
            None => drop(self.largest.insert(robot.clone(), *seq)),
            Some(largest) if *largest < *seq => *largest = *seq,
            Some(largest) => {
                let (robot, later, before) = (robot.clone(), *largest, *seq);
                self.set_back.get_or_insert(SetBack { robot, later, before });
            }
        }
    }

    /// The first contradiction.
    pub(super) fn set_back(&self) -> Option<&SetBack> {
        self.set_back.as_ref()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(readings: &[(Option<i64>, &str, u64)], expected: Option<(u64, u64)>) {
        let mut clocks = Clocks::default();
        for (stamp, robot, seq) in readings {
            let id = ReadingId { robot: (*robot).to_owned(), seq: *seq };
            clocks.take(*stamp, Some(&id));
        }
        clocks.take(Some(i64::MAX), None);
        let found = clocks.set_back().map(|it| (it.later, it.before));
        assert_eq!(found, expected);
    }

    #[test]
    fn only_a_robots_own_numbers_contradict_its_stamps() {
        check(&[], None);
        check(&[(Some(1), "a", 7), (Some(2), "b", 3), (Some(2), "a", 8)], None);
        check(&[(None, "a", 9), (Some(1), "a", 7), (Some(2), "a", 8)], None);
        // Eight readings, then a clock that began again.
        check(&[(Some(0), "a", 8), (Some(2), "a", 9), (Some(100), "a", 0)], Some((9, 0)));
        check(&[(Some(0), "a", 8), (Some(1), "b", 0), (Some(9), "a", 5)], Some((8, 5)));
    }
}
