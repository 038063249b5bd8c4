//! Presses: several frames that a driver sends of one press count once.
//!
//! A press is a run of readings of one robot and one sensor, in the order of readings: each
//! within a second of the one before by the robot's stamps, and each at the pose of the
//! first. The deepest settled frame counts. Readings without a stamp or a pose are separate
//! presses: their time or pose is unknown, and the server's clock is not part of the
//! mathematics. The result depends on the set of readings alone, so no order of arrival
//! changes a belief.

use std::collections::BTreeMap;

use glam::{DQuat, DVec3};
use palpate_core::pose::Pose;
use palpate_core::units::{DEG, MM};
use palpate_store::entity::StoredReading;
use uuid::Uuid;

use super::order::{Added, Touch};

/// Maximum time between two frames of one press, nanoseconds. Chosen: drivers send 10 to
/// 1,000 frames a second, and no arm lifts, moves and presses again within one.
const GAP_NS: i64 = 1_000_000_000;
/// Maximum distance of a press's frames from its first, metres. Chosen: a covering yields by
/// 1 to 4 mm and drags along by as much, and an array is 12 mm wide.
const PLACE: f64 = 5.0 * MM;
/// Maximum rotation of a press's frames, rad. Chosen: an arm that presses yields by less.
const TURN: f64 = 10.0 * DEG;

/// Data that determine the press of a reading, and its depth.
#[derive(Clone, Debug)]
pub(super) struct Frame {
    sensor: Uuid,
    session_from_sensor: Option<Pose>,
    /// The mean of its pressures, Pa; of a contact without an image its force, N, or 1.
    pressure: f64,
    /// Whether the object may have moved before it: then it starts a press.
    object_moved: bool,
}

impl Frame {
    /// The frame of a reading whose pose after its correction is `corrected`.
    pub(super) fn of(reading: &StoredReading, corrected: Option<Pose>) -> Self {
        let (n, sum) = reading
            .pressures
            .iter()
            .flatten()
            .fold((0.0, 0.0), |(n, sum), pressure| (n + 1.0, sum + pressure));
        // A contact that is held reports its place again and again; one that misses tells of
        // another free place each time.
        let held = reading.contact.filter(|contact| contact.touched);
        let at =
            held.map(|held| Pose::from_parts(DQuat::IDENTITY, DVec3::from_array(held.position)));
        let mean = if n > 0.0 { sum / n } else { 0.0 };
        Self {
            sensor: reading.sensor,
            session_from_sensor: corrected.or(at),
            pressure: held.map_or(mean, |held| held.force.unwrap_or(1.0)),
            object_moved: reading.object_moved.is_some(),
        }
    }

    fn is_at_the_place_of(&self, first: &Self) -> bool {
        let (Some(here), Some(there)) = (self.session_from_sensor, first.session_from_sensor)
        else {
            return false;
        };
        self.sensor == first.sensor
            && here.translation.distance(there.translation) <= PLACE
            && here.rotation.angle_between(there.rotation) <= TURN
    }
}

/// The presses of ordered readings, each represented and placed by the reading that counts.
pub(super) fn presses(readings: &[&Added]) -> Vec<Touch> {
    // By their indices in `readings`.
    let mut open: BTreeMap<Option<&str>, Vec<usize>> = BTreeMap::new();
    let mut counted: Vec<(usize, Touch)> = Vec::with_capacity(readings.len());
    for (index, reading) in readings.iter().enumerate() {
        let robot = reading.place.id.as_ref().map(|(robot, _)| robot.as_str());
        let press = open.entry(robot).or_default();
        if !press.is_empty() && !continues(readings, press, reading) {
            counted.push(settled(readings, press));
            press.clear();
        }
        press.push(index);
    }
    counted.extend(open.values().map(|press| settled(readings, press)));
    counted.sort_unstable_by_key(|(index, _)| *index);
    counted.into_iter().map(|(_, touch)| touch).collect()
}

/// Whether a reading continues the robot's present press.
fn continues(readings: &[&Added], press: &[usize], next: &Added) -> bool {
    let (Some(first), Some(last)) = (press.first(), press.last()) else { return false };
    let (Some(before), Some(now)) = (readings[*last].place.stamp_ns, next.place.stamp_ns) else {
        return false;
    };
    !next.frame.object_moved
        && now.saturating_sub(before) <= GAP_NS
        && next.frame.is_at_the_place_of(&readings[*first].frame)
}

/// The frame of a press that counts: the deepest one confirmed by a neighbouring frame, so
/// that neither a momentary impact nor a light frame counts; of equally confirmed ones the
/// deeper, then the later.
fn settled(readings: &[&Added], press: &[usize]) -> (usize, Touch) {
    let pressure = |at: usize| press.get(at).map(|index| readings[*index].frame.pressure);
    let confirmed = |at: usize| {
        let beside = [at.checked_sub(1).and_then(pressure), pressure(at + 1)];
        let deepest = beside.into_iter().flatten().reduce(f64::max);
        let own = pressure(at).unwrap_or(0.0);
        (deepest.map_or(own, |beside| own.min(beside)), own)
    };
    let key = |at: &usize| confirmed(*at);
    let deeper = |a: &usize, b: &usize| {
        let ((a, a_own), (b, b_own)) = (key(a), key(b));
        a.total_cmp(&b).then(a_own.total_cmp(&b_own))
    };
    // `max_by` takes the last of equal ones.
    let at = (0..press.len()).max_by(deeper).unwrap_or(0);
    let (first, index) = (readings[press[0]], press[at]);
    let moved_by = (at > 0 && first.frame.object_moved).then_some(first.place.number);
    (index, Touch { number: readings[index].place.number, moved_by })
}

#[cfg(test)]
mod tests {
    use super::super::order::Place;
    use super::*;

    /// A frame of robot "a" at a time in ms, a depth in mm along z, and a mean pressure.
    fn frame(number: u32, at_ms: i64, z_mm: f64, pressure: f64) -> Added {
        let pose = Pose::new([0.0, 0.0, z_mm * MM], [0.0, 0.0, 0.0, 1.0]).unwrap();
        Added {
            place: Place {
                stamp_ns: Some(at_ms * 1_000_000),
                id: Some(("a".to_owned(), u64::from(number))),
                number,
            },
            frame: Frame {
                sensor: Uuid::nil(),
                session_from_sensor: Some(pose),
                pressure,
                object_moved: false,
            },
        }
    }

    fn counted(frames: &[Added]) -> Vec<u32> {
        presses(&frames.iter().collect::<Vec<_>>()).iter().map(|touch| touch.number).collect()
    }

    /// Frames of one press of these pressures, 33 ms apart.
    fn press(pressures: &[f64]) -> Vec<Added> {
        let one = |(n, pressure): (usize, &f64)| frame(n as u32, 33 * n as i64, 0.0, *pressure);
        pressures.iter().enumerate().map(one).collect()
    }

    #[test]
    fn the_deepest_settled_frame_counts() {
        assert_eq!(counted(&press(&[0.0, 1.0, 2.0, 3.0, 4.0])), [4], "a ramp: its end");
        assert_eq!(counted(&press(&[1.0, 4.0, 4.0, 4.0, 1.0])), [3], "held: the last of equals");
        assert_eq!(counted(&press(&[0.0, 9.0, 4.0, 5.0, 4.5])), [3], "an impact of one frame");
        assert_eq!(counted(&press(&[5.0, 1.0])), [0], "two frames: the deeper");
        assert_eq!(counted(&press(&[0.0, 0.0])), [1], "nothing was touched");
    }

    #[test]
    fn a_press_ends_with_a_pause_another_place_a_sensor_or_a_motion() {
        let after = |change: &dyn Fn(&mut Added)| {
            let mut frames = press(&[1.0, 2.0]);
            change(&mut frames[1]);
            counted(&frames)
        };
        assert_eq!(after(&|_| {}), [1]);
        assert_eq!(after(&|it| it.place.stamp_ns = Some(1_000_000_000)), [1]);
        assert_eq!(after(&|it| it.place.stamp_ns = Some(1_000_000_001)), [0, 1]);
        assert_eq!(after(&|it| it.place.stamp_ns = None), [0, 1]);
        assert_eq!(after(&|it| it.frame = frame(1, 0, 5.1, 2.0).frame), [0, 1]);
        assert_eq!(after(&|it| it.frame.session_from_sensor = None), [0, 1]);
        assert_eq!(after(&|it| it.frame.sensor = Uuid::max()), [0, 1]);
        assert_eq!(after(&|it| it.frame.object_moved = true), [0, 1]);
        assert_eq!(after(&|it| it.place.id = Some(("b".to_owned(), 0))), [0, 1]);
        let held: Vec<Added> = (0..9).map(|n| frame(n, 900 * i64::from(n), 0.0, 1.0)).collect();
        assert_eq!(counted(&held), [8], "however long it is held");
    }

    #[test]
    fn robots_press_concurrently_and_motions_stay_with_a_press() {
        let mut frames = Vec::new();
        for n in 0..4 {
            let mut one = frame(n, 10 * i64::from(n), 0.0, f64::from(n));
            one.place.id = Some(((if n % 2 == 0 { "a" } else { "b" }).to_owned(), u64::from(n)));
            one.frame.object_moved = n == 1;
            frames.push(one);
        }
        let touches = presses(&frames.iter().collect::<Vec<_>>());
        let expected =
            [Touch { number: 2, moved_by: None }, Touch { number: 3, moved_by: Some(1) }];
        assert_eq!(touches, expected);
    }
}
