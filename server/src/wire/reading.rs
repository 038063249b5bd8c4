//! Conversion of readings: checked against their sensor on arrival, returned unchanged.

mod given;

use std::sync::Arc;

use glam::DVec3;
use palpate_core::pose::{Pose, PoseError};
use palpate_core::reading::{Felt, Looseness, Reading};
use palpate_core::sensor::Correction;
use palpate_schemas as wire;
use palpate_schemas::FieldError;
use palpate_store::entity::{ReadingId, Sensor, StoredReading};
use palpate_store::journal::{Entry, Event, NewEntry, ROBOT_BYTES_MAX};
use uuid::Uuid;

use crate::hints::{Judged, of_readings};
use crate::wire::Invalid;
use crate::wire::felt::{self, DEVIATION_MIN, from_store};
use crate::wire::{INTEGER_MAX, outside, sensor};
pub(crate) use given::{Given, READINGS_MAX, TAXELS_MAX, check_size, given};

/// Maximum length of a feature.
const FEATURE_MAX: usize = 4096;
/// The largest value of a feature.
const FEATURE_VALUE_MAX: f64 = 1e9;
/// Maximum number of errors in one answer.
pub(crate) const ERRORS_MAX: usize = 20;
/// The largest coordinate of a position, in metres.
const POSITION_MAX: f64 = 1e6;
/// Maximum length of an approach, metres.
const APPROACH_MAX: f64 = 10.0;
/// Maximum length of a frame's name, in characters.
const FRAME_ID_MAX: usize = 256;
/// Maximum whole seconds of a stamp: beyond it nanoseconds do not fit 64 bits.
const STAMP_SEC_MAX: u64 = 9_000_000_000;

/// A checked reading: in its stored form, and in core's.
#[derive(Clone, Debug)]
pub(crate) struct Incoming {
    /// Pointer to it in its request.
    pub(crate) pointer: String,
    pub(crate) id: Option<ReadingId>,
    pub(crate) stored: StoredReading,
    pub(crate) reading: Felt,
    pub(crate) sensor: Arc<Sensor>,
}

impl Incoming {
    /// The reading in the form of `hints`.
    pub(crate) fn judged(&self) -> Judged<'_> {
        match &self.reading {
            Felt::Press(reading) => Judged::press(reading, &self.sensor.description, self.pose()),
            Felt::Contact(contact) => Judged::contact(contact.position()),
        }
    }

    /// The sensor's pose after the correction, if one was sent.
    pub(crate) fn pose(&self) -> Option<Pose> {
        let press = self.reading.press().filter(|_| self.stored.session_from_sensor.is_some());
        press.map(Reading::session_from_sensor)
    }

    /// The reading as a journal's entry.
    pub(crate) fn entry(&self, received_at_ms: u64, written_by: Option<Uuid>) -> NewEntry {
        let event = Event::Reading(self.stored.clone());
        NewEntry { reading_id: self.id.clone(), received_at_ms, event, written_by }
    }
}

/// A sensor that readings come from, and the calibration that applies to them.
#[derive(Clone, Debug)]
pub(crate) struct Source {
    pub(crate) sensor: Arc<Sensor>,
    pub(crate) applied: Option<Applied>,
}

/// A calibration that applies to readings.
#[derive(Clone, Debug)]
pub(crate) struct Applied {
    pub(crate) number: u32,
    /// Number of the calibration that brought its passport.
    pub(crate) passport: Option<u32>,
    pub(crate) correction: Arc<Correction>,
    /// The sensor that readings are interpreted by: as its passport measured it, or as described.
    pub(crate) sensor: Arc<Sensor>,
}

/// Checks the readings of a request. `sources` are the sensors that they name, if they exist;
/// `frame_id` is the required frame.
pub(crate) fn readings(
    given: &[Given<'_>],
    sources: Vec<Option<Source>>,
    frame_id: Option<&str>,
) -> Result<Vec<Incoming>, Invalid> {
    let mut errors = Vec::new();
    let mut checked = Vec::with_capacity(given.len());
    for ((pointer, reading), source) in given.iter().zip(sources) {
        match one(pointer, reading, source, frame_id) {
            Ok(incoming) => checked.push(incoming),
            Err(Invalid(wrong)) => errors.extend(wrong),
        }
        if errors.len() >= ERRORS_MAX {
            break;
        }
    }
    if errors.is_empty() { Ok(checked) } else { Err(Invalid(errors)) }
}

/// The probable mistakes in the readings of a request, which follow those of a journal whose
/// first reading is at `first`, and what of them the session's `method` leaves out.
pub(crate) fn warnings<'a>(
    readings: impl Iterator<Item = &'a Incoming> + Clone,
    first: Option<DVec3>,
    method: Option<wire::Method>,
) -> Vec<wire::Warning> {
    let judged: Vec<Judged<'_>> = readings.clone().map(Incoming::judged).collect();
    let mut warnings = of_readings(&judged, first);
    warnings.extend(felt::ignored(readings.map(|incoming| &incoming.stored), method));
    warnings
}

/// Checks the reading at `pointer`.
pub(crate) fn one(
    pointer: &str,
    given: &wire::Reading,
    source: Option<Source>,
    frame_id: Option<&str>,
) -> Result<Incoming, Invalid> {
    let id = reading_id(pointer, given)?;
    frame(pointer, given, frame_id)?;
    let Source { sensor, applied } =
        source.ok_or_else(|| no_sensor(&format!("{pointer}/sensor"), &given.sensor))?;
    let contact = felt::contact(pointer, given)?;
    felt::shear(pointer, given, &sensor.description)?;
    // There are no pressures to correct, and positions of contacts stay as stated.
    let applied = applied.filter(|_| contact.is_none());
    let pose = given.pose.as_ref().map(|given| pose(&format!("{pointer}/pose"), given));
    feature(&format!("{pointer}/feature"), given.feature.as_deref())?;
    let stored = StoredReading {
        sensor: sensor.id,
        session_from_sensor: pose.transpose()?,
        pressures: given.image.clone(),
        stamp_ns: given.stamp.map(|given| stamp_ns(pointer, given)).transpose()?,
        calibration: applied.as_ref().map_or(0, |applied| applied.number),
        feature: given.feature.clone(),
        approach: approach(pointer, given)?,
        object_moved: object_moved(pointer, given)?,
        contact,
        shear: given.shear.clone(),
    };
    let correction = applied.as_ref().map(|applied| &*applied.correction);
    let reading =
        from_store(&stored, &sensor, correction).map_err(|error| felt::refused(pointer, error))?;
    let sensor = applied.map_or(sensor, |applied| applied.sensor);
    Ok(Incoming { pointer: pointer.to_owned(), id, stored, reading, sensor })
}

/// The error of a sensor that does not exist.
pub(crate) fn no_sensor(pointer: &str, named: &str) -> Invalid {
    Invalid::field(pointer, format!("there is no sensor {named:?}, expected an id or a name"))
}

/// The length of a press's free path, metres, checked.
fn approach(pointer: &str, given: &wire::Reading) -> Result<f64, Invalid> {
    let metres = given.approach_m.unwrap_or(0.0);
    if (0.0..=APPROACH_MAX).contains(&metres) {
        return Ok(metres);
    }
    let expected = format!("metres from 0 to {APPROACH_MAX}");
    Err(outside(format!("{pointer}/approach_m"), metres, [0.0, APPROACH_MAX], &expected))
}

/// The possible motion of the object, checked.
fn object_moved(pointer: &str, given: &wire::Reading) -> Result<Option<Looseness>, Invalid> {
    let pointer = format!("{pointer}/object_moved");
    given.object_moved.map(|moved| looseness(&pointer, moved)).transpose()
}

/// Deviations of a pose, checked.
pub(crate) fn looseness(pointer: &str, given: wire::Looseness) -> Result<Looseness, Invalid> {
    let number = |field: &str, value: f64, high: f64| {
        super::number(&format!("{pointer}/{field}"), value, DEVIATION_MIN, high)
    };
    Ok(Looseness {
        position: number("position_m", given.position_m, 0.1)?,
        angle: number("angle_rad", given.angle_rad, 1.0)?,
    })
}

/// A stored training reading in its wire form; `None` for other entries.
pub(crate) fn stored(
    entry: &Entry,
    writer: impl Fn(Uuid) -> wire::Writer,
) -> Option<wire::StoredReading> {
    let Event::Reading(reading) = &entry.event else { return None };
    Some(wire::StoredReading {
        index: super::count(entry.seq),
        robot: entry.reading_id.as_ref().map(|id| id.robot.clone()),
        seq: entry.reading_id.as_ref().map(|id| id.seq),
        written_by: entry.written_by.map(&writer),
        sensor: reading.sensor,
        stamp: reading.stamp_ns.map(stamp),
        pose: reading.session_from_sensor.as_ref().map(sensor::pose),
        image: reading.pressures.clone(),
        shear: reading.shear.clone(),
        calibration: (reading.calibration > 0).then_some(reading.calibration),
        feature: reading.feature.clone(),
        approach_m: reading.approach,
    })
}

/// A stored reading of a session in its wire form, with the entry that withdraws it and the pose
/// after its correction; `None` for other entries.
pub(crate) fn of_session(
    entry: &Entry,
    withdrawn_by: Option<&Entry>,
    corrected: Option<Pose>,
    writer: impl Fn(Uuid) -> wire::Writer,
) -> Option<wire::SessionReading> {
    let Event::Reading(reading) = &entry.event else { return None };
    let moved =
        |moved: Looseness| wire::Looseness { position_m: moved.position, angle_rad: moved.angle };
    Some(wire::SessionReading {
        number: super::count(entry.seq),
        robot: entry.reading_id.as_ref().map(|id| id.robot.clone()),
        seq: entry.reading_id.as_ref().map(|id| id.seq),
        sensor: reading.sensor,
        stamp: reading.stamp_ns.map(stamp),
        received_at: super::time(entry.received_at_ms),
        written_by: entry.written_by.map(&writer),
        retracted_by: withdrawn_by.map(|by| super::count(by.seq + 1)),
        retraction_written_by: withdrawn_by.and_then(|by| by.written_by).map(&writer),
        pose: reading.session_from_sensor.as_ref().map(sensor::pose),
        corrected_pose: corrected
            .filter(|pose| Some(*pose) != reading.session_from_sensor)
            .as_ref()
            .map(sensor::pose),
        image: reading.pressures.clone(),
        contact: reading.contact.map(felt::shown),
        shear: reading.shear.clone(),
        calibration: (reading.calibration > 0).then_some(reading.calibration),
        feature: reading.feature.clone(),
        approach_m: reading.approach,
        object_moved: reading.object_moved.map(moved),
    })
}

/// Checks a pose.
pub(crate) fn pose(pointer: &str, given: &wire::Pose) -> Result<Pose, Invalid> {
    let far = given.position.iter().position(|value| value.abs() > POSITION_MAX);
    if let Some(axis) = far {
        let at = format!("{pointer}/position/{axis}");
        let expected = format!("metres within ±{POSITION_MAX}");
        return Err(outside(at, given.position[axis], [-POSITION_MAX, POSITION_MAX], &expected));
    }
    Pose::new(given.position, given.orientation).map_err(|error| match error {
        PoseError::Position { axis, .. } => {
            Invalid::field(format!("{pointer}/position/{axis}"), error)
        }
        PoseError::Component { component, .. } => {
            Invalid::field(format!("{pointer}/orientation/{component}"), error)
        }
        PoseError::Norm { norm } if norm <= f64::EPSILON => Invalid::field(
            format!("{pointer}/orientation"),
            format!("{error}; a quaternion of zeros is one that nobody has set"),
        ),
        PoseError::Norm { .. } => Invalid::field(format!("{pointer}/orientation"), error),
    })
}

/// Checks a client's own feature.
fn feature(pointer: &str, given: Option<&[f64]>) -> Result<(), Invalid> {
    let Some(feature) = given else { return Ok(()) };
    if !(1..=FEATURE_MAX).contains(&feature.len()) {
        let detail = format!("{} values came, expected 1 to {FEATURE_MAX}", feature.len());
        return Err(Invalid::field(pointer, detail));
    }
    let within = |value: &f64| value.abs() <= FEATURE_VALUE_MAX;
    match feature.iter().position(|value| !within(value)) {
        None => Ok(()),
        Some(place) => {
            let expected = format!("a number within ±{FEATURE_VALUE_MAX:e}");
            let limits = [-FEATURE_VALUE_MAX, FEATURE_VALUE_MAX];
            Err(outside(format!("{pointer}/{place}"), feature[place], limits, &expected))
        }
    }
}

fn reading_id(pointer: &str, given: &wire::Reading) -> Result<Option<ReadingId>, Invalid> {
    let (robot, seq) = match (&given.robot, given.seq) {
        (None, None) => return Ok(None),
        (Some(robot), Some(seq)) => (robot.clone(), seq),
        (Some(_), None) => {
            let detail = "robot came without seq, expected both or neither";
            return Err(Invalid::field(format!("{pointer}/seq"), detail));
        }
        (None, Some(_)) => {
            let detail = "seq came without robot, expected both or neither";
            return Err(Invalid::field(format!("{pointer}/robot"), detail));
        }
    };
    self::robot(&format!("{pointer}/robot"), &robot)?;
    super::within(&format!("{pointer}/seq"), seq, 0, INTEGER_MAX)?;
    Ok(Some(ReadingId { robot, seq }))
}

/// Checks a robot's name.
pub(crate) fn robot(pointer: &str, robot: &str) -> Result<(), Invalid> {
    if robot.is_empty() || robot.len() > ROBOT_BYTES_MAX || robot.chars().any(super::is_control) {
        let detail = format!("came {robot:?}, expected 1 to {ROBOT_BYTES_MAX} printable bytes");
        return Err(Invalid::field(pointer, detail));
    }
    Ok(())
}

/// The name of a frame: ROS states none as an empty text, and older systems begin names with a
/// slash.
pub(crate) fn frame_name(given: &str) -> Option<&str> {
    Some(given.strip_prefix('/').unwrap_or(given)).filter(|name| !name.is_empty())
}

fn frame(pointer: &str, given: &wire::Reading, expected: Option<&str>) -> Result<(), Invalid> {
    let Some(found) = given.frame_id.as_deref().and_then(frame_name) else { return Ok(()) };
    let at = format!("{pointer}/frame_id");
    super::text(&at, found, FRAME_ID_MAX)?;
    let detail = match expected {
        Some(expected) if frame_name(expected) == Some(found) => return Ok(()),
        Some(expected) => format!(
            "came {found:?}, expected {expected:?}: transform the pose into that frame before it is \
             sent"
        ),
        None => format!(
            "came {found:?}, but the session was created without a frame_id: name the frame there, \
             or leave it out here"
        ),
    };
    Err(Invalid::field(at, detail))
}

fn stamp_ns(pointer: &str, given: wire::Stamp) -> Result<i64, Invalid> {
    super::within(&format!("{pointer}/stamp/sec"), given.sec, 0, STAMP_SEC_MAX)?;
    let nanosec = u64::from(given.nanosec);
    super::within(&format!("{pointer}/stamp/nanosec"), nanosec, 0, 999_999_999)?;
    Ok((given.sec * 1_000_000_000 + nanosec) as i64)
}

pub(super) fn stamp(ns: i64) -> wire::Stamp {
    let ns = u64::try_from(ns).unwrap_or(0);
    wire::Stamp { sec: ns / 1_000_000_000, nanosec: (ns % 1_000_000_000) as u32 }
}

/// The common frame of a request's readings, or a refusal.
pub(crate) fn shared_frame<'a>(given: &'a [wire::Reading]) -> Result<Option<&'a str>, Invalid> {
    let named = |reading: &'a wire::Reading| reading.frame_id.as_deref().and_then(frame_name);
    let first = given.first().and_then(named);
    let other = given.iter().position(|reading| named(reading) != first);
    let shown = |name: Option<&str>| name.map_or("null".to_owned(), |name| format!("{name:?}"));
    match other {
        None => Ok(first),
        Some(index) => Err(Invalid(vec![FieldError {
            pointer: format!("/readings/{index}/frame_id"),
            detail: format!(
                "came {}, expected {} as in the first reading: training readings are given in one \
                 frame in which the object is at rest",
                shown(named(&given[index])),
                shown(first)
            ),
        }])),
    }
}
