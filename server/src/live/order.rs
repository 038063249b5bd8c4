//! The folding order of a session's presses, independent of the order of arrival.
//!
//! Readings are ordered by their time stamps (those without one come first), then by robot,
//! then by the robot's own number. A reading without an id comes before those with an id of
//! the same stamp, in order of arrival. One frame of each press counts (`presses`), in its
//! own place. So the order of readings with ids is a function of their set. Not here:
//! beliefs.

use std::collections::BTreeSet;

use palpate_core::pose::Pose;
use palpate_store::entity::{ReadingId, StoredReading};
use palpate_store::journal::{Entry, Event};

use super::presses::{Frame, presses};

/// Approximate memory of a robot's name.
const ROBOT_BYTES: usize = 16;
/// Mark, in a stored order, of a reading whose announced motion precedes the next one's
/// press. Numbers of readings are below: a session has 10,000 or a few more.
const MOVES: u32 = 1 << 31;

/// Sort key of a reading; the order of the fields is the order of readings.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Place {
    pub(super) stamp_ns: Option<i64>,
    pub(super) id: Option<(String, u64)>,
    pub(super) number: u32,
}

/// A reading that arrived: its sort key, and the data that determine its press.
#[derive(Clone, Debug)]
pub(super) struct Added {
    pub(super) place: Place,
    pub(super) frame: Frame,
}

/// A press in the order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Touch {
    /// The reading that counts.
    pub(crate) number: u32,
    /// The first frame of the press, if it announced a motion and is another reading.
    pub(crate) moved_by: Option<u32>,
}

/// Effect of a journal entry on the readings.
#[derive(Clone, Debug)]
enum Change {
    Adds(Box<Added>),
    Withdraws(u32),
    Nothing,
}

/// Content of a journal's first entries, and the order of the presses that count.
#[derive(Clone, Debug, Default)]
pub(crate) struct Chronicle {
    changes: Vec<Change>,
    /// Numbers of the readings that are not withdrawn, in their order.
    standing: Vec<u32>,
    /// The presses in folding order, as of the last settling.
    order: Vec<Touch>,
}

impl Chronicle {
    /// Approximate memory; names of robots are short.
    pub(crate) fn bytes(&self) -> usize {
        self.changes.capacity() * (size_of::<Change>() + size_of::<Added>() + ROBOT_BYTES)
            + self.standing.capacity() * size_of::<u32>()
            + self.order.capacity() * size_of::<Touch>()
    }

    /// Number of known entries.
    pub(crate) fn len(&self) -> usize {
        self.changes.len()
    }

    /// The presses in folding order, as of the last settling.
    pub(crate) fn order(&self) -> &[Touch] {
        &self.order
    }

    /// Takes the journal's next entry, with the pose of a reading after its correction; the order is
    /// settled later.
    pub(crate) fn take(&mut self, entry: &Entry, corrected: Option<Pose>) {
        let change = match &entry.event {
            Event::Reading(reading) => {
                return self.take_reading(entry.reading_id.as_ref(), reading, corrected);
            }
            Event::Retraction { seq } => {
                let withdrawn = u32::try_from(*seq).unwrap_or(u32::MAX);
                self.standing.retain(|number| *number != withdrawn);
                Change::Withdraws(withdrawn)
            }
            Event::Closed => Change::Nothing,
        };
        self.changes.push(change);
    }

    /// Takes the journal's next entry, which is a reading.
    pub(super) fn take_reading(
        &mut self,
        id: Option<&ReadingId>,
        reading: &StoredReading,
        corrected: Option<Pose>,
    ) {
        let number = self.changes.len() as u32;
        let id = id.map(|id| (id.robot.clone(), id.seq));
        let place = Place { stamp_ns: reading.stamp_ns, id, number };
        let before = |other: &u32| self.added(*other).map(|one| &one.place) < Some(&place);
        let at = self.standing.partition_point(before);
        self.standing.insert(at, number);
        let frame = Frame::of(reading, corrected);
        self.changes.push(Change::Adds(Box::new(Added { place, frame })));
    }

    /// Updates the order to the entries taken; the number of presses at its start that are
    /// unchanged.
    pub(crate) fn settle(&mut self) -> usize {
        let standing = self.standing.iter().filter_map(|number| self.added(*number));
        let order = presses(&standing.collect::<Vec<_>>());
        let both = self.order.iter().zip(&order);
        let stays = both.take_while(|(before, now)| before == now).count();
        self.order = order;
        stays
    }

    /// The order after the first `n_entries` entries, as it was then.
    pub(crate) fn order_at(&self, n_entries: usize) -> Vec<Touch> {
        let changes = &self.changes[..n_entries.min(self.changes.len())];
        let withdrawn: BTreeSet<u32> = changes.iter().filter_map(Change::withdraws).collect();
        let adds = changes.iter().filter_map(Change::adds);
        let mut standing: Vec<&Added> =
            adds.filter(|added| !withdrawn.contains(&added.place.number)).collect();
        standing.sort_unstable_by(|a, b| a.place.cmp(&b.place));
        presses(&standing)
    }

    fn added(&self, number: u32) -> Option<&Added> {
        self.changes.get(number as usize)?.adds()
    }
}

/// The stored form of an order: the numbers of its readings, those of announced motions marked.
pub(crate) fn stored_order(order: &[Touch]) -> Vec<u32> {
    let numbers = |touch: &Touch| {
        let moves = touch.moved_by.map(|number| number | MOVES);
        moves.into_iter().chain([touch.number])
    };
    order.iter().flat_map(numbers).collect()
}

/// The number of presses of a stored order, if `order` begins with it.
pub(crate) fn begins_with(order: &[Touch], stored: &[u32]) -> Option<usize> {
    let n = stored.iter().filter(|number| **number & MOVES == 0).count();
    (stored_order(order.get(..n)?) == stored).then_some(n)
}

impl Change {
    fn adds(&self) -> Option<&Added> {
        match self {
            Self::Adds(added) => Some(added),
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
            contact: None,
            shear: None,
        });
        let reading_id = id.map(|(robot, seq)| ReadingId { robot: robot.to_owned(), seq });
        Entry {
            seq: chronicle.len() as u64,
            reading_id,
            received_at_ms: 0,
            event,
            written_by: None,
        }
    }

    fn take(chronicle: &mut Chronicle, entry: &Entry) -> usize {
        chronicle.take(entry, None);
        chronicle.settle()
    }

    fn order(chronicle: &Chronicle) -> Vec<u32> {
        chronicle.order().iter().map(|touch| touch.number).collect()
    }

    fn withdraw(chronicle: &mut Chronicle, seq: u64) -> usize {
        let entry = Entry {
            seq: chronicle.len() as u64,
            reading_id: None,
            written_by: None,
            received_at_ms: 0,
            event: Event::Retraction { seq },
        };
        take(chronicle, &entry)
    }

    fn chronicle(readings: &[Stamped<'_>]) -> Chronicle {
        let mut chronicle = Chronicle::default();
        for reading in readings {
            let entry = entry(&chronicle, *reading);
            chronicle.take(&entry, None);
        }
        chronicle.settle();
        chronicle
    }

    #[test]
    fn readings_sort_by_stamp_robot_number_and_arrival() {
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
        assert_eq!(order(&it), [6, 8, 4, 7, 5, 3, 2, 1, 0]);
    }

    #[test]
    fn presses_before_a_late_or_retracted_reading_stay() {
        let mut it = chronicle(&[
            reading(Some(1), Some(("a", 1))),
            reading(Some(2), Some(("a", 2))),
            reading(Some(4), Some(("a", 3))),
        ]);
        let late = entry(&it, reading(Some(3), Some(("b", 1))));
        assert_eq!((take(&mut it, &late), order(&it)), (2, vec![0, 1, 3, 2]));
        let newest = entry(&it, reading(Some(9), Some(("b", 2))));
        assert_eq!(take(&mut it, &newest), 4, "all of them");
        assert_eq!((withdraw(&mut it, 1), order(&it)), (1, vec![0, 3, 2, 4]));
        assert_eq!((withdraw(&mut it, 1), it.order().len()), (4, 4), "it is gone already");
        let closed = Entry { event: Event::Closed, ..late };
        assert_eq!((take(&mut it, &closed), it.len()), (4, 8));
    }

    #[test]
    fn an_earlier_order_ignores_later_entries() {
        let mut it = chronicle(&[
            reading(Some(7), Some(("a", 1))),
            reading(Some(6), Some(("a", 2))),
            reading(Some(5), Some(("a", 3))),
        ]);
        withdraw(&mut it, 1);
        let number = |touch: Touch| touch.number;
        let orders: Vec<Vec<u32>> =
            (0..=5).map(|n| it.order_at(n).into_iter().map(number).collect()).collect();
        let all = vec![vec![], vec![0], vec![1, 0], vec![2, 1, 0], vec![2, 0], vec![2, 0]];
        assert_eq!(orders, all);
        assert_eq!(it.order_at(4), it.order());
    }
}
