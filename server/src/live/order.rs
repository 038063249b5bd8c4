//! The one order in which a session's readings are folded, whatever order they came in.
//!
//! Readings are ordered by their time stamps (those without one come first), then by robot,
//! then by the robot's own number; without an id, a reading stands where it came among those
//! of its stamp, before those with an id. So the order of readings with ids is a function of
//! their set. Not here: beliefs.

use std::collections::BTreeSet;

use palpate_store::journal::{Entry, Event};

/// What a robot's name takes in memory, about.
const ROBOT_BYTES: usize = 16;

/// Where a reading stands. The order of the fields is the order of readings.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Place {
    stamp_ns: Option<i64>,
    id: Option<(String, u64)>,
    number: u32,
}

/// What an entry of the journal does to the readings.
#[derive(Clone, Debug)]
enum Change {
    Adds(Place),
    Withdraws(u32),
    Nothing,
}

/// What a journal's first entries say, and the order of the readings that count.
#[derive(Clone, Debug, Default)]
pub(crate) struct Chronicle {
    changes: Vec<Change>,
    /// Numbers of the readings that are not withdrawn, in the order in which they are folded.
    order: Vec<u32>,
}

impl Chronicle {
    /// Bytes of what is known, about: names of robots are short.
    pub(crate) fn bytes(&self) -> usize {
        self.changes.capacity() * (size_of::<Change>() + ROBOT_BYTES)
            + self.order.capacity() * size_of::<u32>()
    }

    /// How many entries are known.
    pub(crate) fn len(&self) -> usize {
        self.changes.len()
    }

    /// Numbers of the readings that count, in the order in which they are folded.
    pub(crate) fn order(&self) -> &[u32] {
        &self.order
    }

    /// Takes the journal's next entry; gives how many readings of the order stay as they were.
    pub(crate) fn take(&mut self, entry: &Entry) -> usize {
        match &entry.event {
            Event::Reading(reading) => {
                let number = self.changes.len() as u32;
                let id = entry.reading_id.as_ref().map(|id| (id.robot.clone(), id.seq));
                let place = Place { stamp_ns: reading.stamp_ns, id, number };
                let at = self.order.partition_point(|other| self.place(*other) < Some(&place));
                self.order.insert(at, number);
                self.changes.push(Change::Adds(place));
                at
            }
            Event::Retraction { seq } => {
                let withdrawn = u32::try_from(*seq).unwrap_or(u32::MAX);
                self.changes.push(Change::Withdraws(withdrawn));
                match self.order.iter().position(|number| *number == withdrawn) {
                    Some(at) => {
                        self.order.remove(at);
                        at
                    }
                    None => self.order.len(),
                }
            }
            Event::Closed => {
                self.changes.push(Change::Nothing);
                self.order.len()
            }
        }
    }

    /// The order after the first `n_entries` entries, as it was then.
    pub(crate) fn order_at(&self, n_entries: usize) -> Vec<u32> {
        let changes = &self.changes[..n_entries.min(self.changes.len())];
        let withdrawn: BTreeSet<u32> = changes.iter().filter_map(Change::withdraws).collect();
        let adds = changes.iter().filter_map(Change::adds);
        let mut places: Vec<&Place> =
            adds.filter(|place| !withdrawn.contains(&place.number)).collect();
        places.sort_unstable();
        places.into_iter().map(|place| place.number).collect()
    }

    fn place(&self, number: u32) -> Option<&Place> {
        self.changes.get(number as usize)?.adds()
    }
}

impl Change {
    fn adds(&self) -> Option<&Place> {
        match self {
            Self::Adds(place) => Some(place),
            Self::Withdraws(_) | Self::Nothing => None,
        }
    }

    fn withdraws(&self) -> Option<u32> {
        match self {
            Self::Withdraws(number) => Some(*number),
            Self::Adds(_) | Self::Nothing => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use palpate_store::entity::{ReadingId, StoredReading};
    use uuid::Uuid;

    use super::*;

    type Stamped<'a> = (Option<i64>, Option<(&'a str, u64)>);

    fn reading(stamp_ns: Option<i64>, id: Option<(&'static str, u64)>) -> Stamped<'static> {
        (stamp_ns, id)
    }

    fn entry(chronicle: &Chronicle, (stamp_ns, id): Stamped<'_>) -> Entry {
        let event = Event::Reading(StoredReading {
            sensor: Uuid::nil(),
            session_from_sensor: None,
            pressures: Vec::new(),
            stamp_ns,
            calibration: 0,
            feature: None,
            approach: 0.0,
            object_moved: None,
        });
        let reading_id = id.map(|(robot, seq)| ReadingId { robot: robot.to_owned(), seq });
        Entry { seq: chronicle.len() as u64, reading_id, received_at_ms: 0, event }
    }

    fn withdraw(chronicle: &mut Chronicle, seq: u64) -> usize {
        let entry = Entry {
            seq: chronicle.len() as u64,
            reading_id: None,
            received_at_ms: 0,
            event: Event::Retraction { seq },
        };
        chronicle.take(&entry)
    }

    fn chronicle(readings: &[Stamped<'_>]) -> Chronicle {
        let mut chronicle = Chronicle::default();
        for reading in readings {
            let entry = entry(&chronicle, *reading);
            chronicle.take(&entry);
        }
        chronicle
    }

    #[test]
    fn stamps_come_first_then_robots_then_their_numbers_then_arrival() {
        let it = chronicle(&[
            reading(Some(5), Some(("a", 0))),   // 0
            reading(Some(4), Some(("b", 9))),   // 1
            reading(Some(4), Some(("a", 10))),  // 2
            reading(Some(4), Some(("a", 9))),   // 3
            reading(None, Some(("z", 1))),      // 4
            reading(Some(4), None),             // 5
            reading(None, None),                // 6
            reading(Some(-1), Some(("a", 11))), // 7
            reading(None, None),                // 8
        ]);
        assert_eq!(it.order(), [6, 8, 4, 7, 5, 3, 2, 1, 0]);
    }

    #[test]
    fn what_stays_is_before_the_late_reading_or_the_withdrawn_one() {
        let mut it = chronicle(&[
            reading(Some(1), Some(("a", 1))),
            reading(Some(2), Some(("a", 2))),
            reading(Some(4), Some(("a", 3))),
        ]);
        let late = entry(&it, reading(Some(3), Some(("b", 1))));
        assert_eq!((it.take(&late), it.order()), (2, &[0, 1, 3, 2][..]));
        let newest = entry(&it, reading(Some(9), Some(("b", 2))));
        assert_eq!(it.take(&newest), 4, "all of them");
        assert_eq!((withdraw(&mut it, 1), it.order()), (1, &[0, 3, 2, 4][..]));
        assert_eq!((withdraw(&mut it, 1), it.order().len()), (4, 4), "it is gone already");
        let closed = Entry { event: Event::Closed, ..late };
        assert_eq!((it.take(&closed), it.len()), (4, 8));
    }

    #[test]
    fn the_order_of_an_earlier_time_knows_nothing_of_what_came_later() {
        let mut it = chronicle(&[
            reading(Some(7), Some(("a", 1))),
            reading(Some(6), Some(("a", 2))),
            reading(Some(5), Some(("a", 3))),
        ]);
        withdraw(&mut it, 1);
        let orders: Vec<Vec<u32>> = (0..=5).map(|n| it.order_at(n)).collect();
        let all = vec![vec![], vec![0], vec![1, 0], vec![2, 1, 0], vec![2, 0], vec![2, 0]];
        assert_eq!(orders, all);
        assert_eq!(it.order_at(4), it.order());
    }
}
