//! Stored forms of a journal's head, entries and indexes.
//!
//! Entries have schema 6: schema 5 and, of a reading, a contact without an image, and shear.
//! Schema 5 is schema 4 and the writer's API key. Entries of schemas 4 and 5 are read as ones
//! without what they do not have, and stay unchanged. Schemas 1
//! to 3 belong to layout 1; `migrations` converts them, and nothing else reads them.

use bincode::{Decode, Encode};
use palpate_core::pose::Pose;
use palpate_core::reading::Looseness;
use palpate_core::reading::point_contact::ContactNumbers;
use uuid::Uuid;

use super::{Entry, Event, Head};
use crate::entity::{ReadingId, StoredReading};
use crate::envelope::Kind;
use crate::error::RecordError;
use crate::record::{IdV1, Plain, Record, read, write};

/// Head of schema 1, which has only the number of entries.
#[derive(Encode, Decode)]
struct JournalHeadV1 {
    next: u64,
}

#[derive(Encode, Decode)]
struct JournalHeadV2 {
    next: u64,
    n_retracted: u64,
    last_at_ms: Option<u64>,
    is_closed: bool,
}

/// A stored head, of schema 2, or of schema 1, which has only the number of the journal's entries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum StoredHead {
    Whole(Head),
    Length(u64),
}

impl StoredHead {
    /// Number of entries of the journal.
    pub(crate) fn length(&self) -> u64 {
        match self {
            Self::Whole(head) => head.length,
            Self::Length(length) => *length,
        }
    }
}

impl Record for StoredHead {
    const KIND: Kind = Kind::JournalHead;
    const SCHEMA: u16 = 2;

    fn to_payload(&self) -> Vec<u8> {
        let head = match *self {
            Self::Whole(head) => head,
            Self::Length(length) => Head { length, ..Head::default() },
        };
        let Head { length: next, n_retracted, last_at_ms, is_closed } = head;
        write(&JournalHeadV2 { next, n_retracted, last_at_ms, is_closed })
    }

    fn from_payload(payload: &[u8]) -> Result<Self, RecordError> {
        let JournalHeadV2 { next, n_retracted, last_at_ms, is_closed } = read(payload)?;
        Ok(Self::Whole(Head { length: next, n_retracted, last_at_ms, is_closed }))
    }

    fn from_older(_schema: u16, payload: &[u8]) -> Result<Self, RecordError> {
        let JournalHeadV1 { next } = read(payload)?;
        Ok(Self::Length(next))
    }
}

/// Position in a journal of a robot's reading number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode)]
pub(crate) struct JournalRobotV1 {
    pub(crate) seq: u64,
}

/// The journal entry that withdraws another one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode)]
pub(crate) struct JournalRetractionV1 {
    pub(crate) seq: u64,
}

impl Plain for JournalRobotV1 {
    const KIND: Kind = Kind::JournalRobot;
}

impl Plain for JournalRetractionV1 {
    const KIND: Kind = Kind::JournalRetraction;
}

#[derive(Encode, Decode)]
struct JournalEntryV6 {
    entry: JournalEntryV5,
    contact: Option<ContactV1>,
    /// Two values a taxel; NaN for one without.
    shear: Option<Vec<u8>>,
}

#[derive(Encode, Decode)]
struct ContactV1 {
    touched: bool,
    position: [f64; 3],
    position_deviation: f64,
    normal: Option<[f64; 3]>,
    normal_deviation: Option<f64>,
    force: Option<f64>,
}

#[derive(Encode, Decode)]
struct JournalEntryV5 {
    entry: JournalEntryV4,
    written_by: Option<IdV1>,
}

#[derive(Encode, Decode)]
struct JournalEntryV4 {
    seq: u64,
    received_at_ms: u64,
    reading_id: Option<(String, u64)>,
    event: EventV4,
}

#[derive(Encode, Decode)]
enum EventV4 {
    Reading {
        sensor: IdV1,
        /// Position, then quaternion x, y, z, w.
        pose: Option<([f64; 3], [f64; 4])>,
        stamp_ns: Option<i64>,
        pressures: Vec<u8>,
        calibration: u32,
        feature: Option<Vec<u8>>,
        approach: f64,
        /// Metres, rad.
        object_moved: Option<(f64, f64)>,
    },
    Retraction {
        seq: u64,
    },
    Closed,
}

impl Record for Entry {
    const KIND: Kind = Kind::JournalEntry;
    const SCHEMA: u16 = 6;

    fn to_payload(&self) -> Vec<u8> {
        let event = match &self.event {
            Event::Reading(reading) => EventV4::Reading {
                sensor: reading.sensor.into_bytes(),
                pose: reading
                    .session_from_sensor
                    .map(|pose| (pose.translation.to_array(), pose.rotation.to_array())),
                stamp_ns: reading.stamp_ns,
                pressures: pressures_to_bytes(&reading.pressures),
                calibration: reading.calibration,
                feature: reading.feature.as_deref().map(feature_to_bytes),
                approach: reading.approach,
                object_moved: reading.object_moved.map(|moved| (moved.position, moved.angle)),
            },
            Event::Retraction { seq } => EventV4::Retraction { seq: *seq },
            Event::Closed => EventV4::Closed,
        };
        let reading_id = self.reading_id.as_ref().map(|id| (id.robot.clone(), id.seq));
        let entry = JournalEntryV4 {
            seq: self.seq,
            received_at_ms: self.received_at_ms,
            reading_id,
            event,
        };
        let entry = JournalEntryV5 { entry, written_by: self.written_by.map(Uuid::into_bytes) };
        let (contact, shear) = match &self.event {
            Event::Reading(reading) => (reading.contact, reading.shear.as_deref()),
            Event::Retraction { .. } | Event::Closed => (None, None),
        };
        let contact = contact.map(stored_contact);
        write(&JournalEntryV6 { entry, contact, shear: shear.map(shear_to_bytes) })
    }

    fn from_payload(payload: &[u8]) -> Result<Self, RecordError> {
        let JournalEntryV6 { entry, contact, shear } = read(payload)?;
        let mut entry = signed(entry)?;
        if let Event::Reading(reading) = &mut entry.event {
            reading.contact = contact.map(contact_numbers);
            reading.shear = shear.map(|bytes| shear_from_bytes(&bytes)).transpose()?;
        }
        Ok(entry)
    }

    fn from_older(schema: u16, payload: &[u8]) -> Result<Self, RecordError> {
        match schema {
            4 => unsigned(read(payload)?),
            5 => signed(read(payload)?),
            found => Err(RecordError::Schema { found, known: Self::SCHEMA }),
        }
    }
}

/// An entry of schema 5, without a contact and without shear.
fn signed(JournalEntryV5 { entry, written_by }: JournalEntryV5) -> Result<Entry, RecordError> {
    Ok(Entry { written_by: written_by.map(Uuid::from_bytes), ..unsigned(entry)? })
}

/// An entry of schema 4, without a recorded key.
fn unsigned(stored: JournalEntryV4) -> Result<Entry, RecordError> {
    let event = match stored.event {
        EventV4::Reading {
            sensor,
            pose,
            stamp_ns,
            pressures,
            calibration,
            feature,
            approach,
            object_moved,
        } => {
            let pose = pose.map(|(position, quaternion)| Pose::stored(position, quaternion));
            let feature = feature.map(|bytes| floats(&bytes));
            Event::Reading(StoredReading {
                sensor: Uuid::from_bytes(sensor),
                session_from_sensor: pose.transpose()?,
                pressures: pressures_from_bytes(&pressures)?,
                stamp_ns,
                calibration,
                feature: feature.transpose()?,
                approach,
                object_moved: object_moved.map(|(position, angle)| Looseness { position, angle }),
                contact: None,
                shear: None,
            })
        }
        EventV4::Retraction { seq } => Event::Retraction { seq },
        EventV4::Closed => Event::Closed,
    };
    let reading_id = stored.reading_id.map(|(robot, seq)| ReadingId { robot, seq });
    let JournalEntryV4 { seq, received_at_ms, .. } = stored;
    Ok(Entry { seq, received_at_ms, reading_id, event, written_by: None })
}

fn pressures_to_bytes(pressures: &[Option<f64>]) -> Vec<u8> {
    pressures.iter().flat_map(|pressure| pressure.unwrap_or(f64::NAN).to_le_bytes()).collect()
}

fn pressures_from_bytes(bytes: &[u8]) -> Result<Vec<Option<f64>>, RecordError> {
    let values = floats(bytes)?;
    Ok(values.into_iter().map(|value| Some(value).filter(|value| !value.is_nan())).collect())
}

fn stored_contact(contact: ContactNumbers) -> ContactV1 {
    let ContactNumbers { touched, position, position_deviation, .. } = contact;
    let ContactNumbers { normal, normal_deviation, force, .. } = contact;
    ContactV1 { touched, position, position_deviation, normal, normal_deviation, force }
}

/// The numbers of a contact, bit by bit as stored.
fn contact_numbers(contact: ContactV1) -> ContactNumbers {
    let ContactV1 { touched, position, position_deviation, .. } = contact;
    let ContactV1 { normal, normal_deviation, force, .. } = contact;
    ContactNumbers { touched, position, position_deviation, normal, normal_deviation, force }
}

fn shear_to_bytes(shear: &[Option<[f64; 2]>]) -> Vec<u8> {
    let values = shear.iter().flat_map(|taxel| taxel.unwrap_or([f64::NAN; 2]));
    values.flat_map(f64::to_le_bytes).collect()
}

fn shear_from_bytes(bytes: &[u8]) -> Result<Vec<Option<[f64; 2]>>, RecordError> {
    let values = floats(bytes)?;
    let (taxels, rest) = values.as_chunks::<2>();
    if !rest.is_empty() {
        let consumed = bytes.len() - size_of::<f64>();
        return Err(RecordError::Trailing { consumed, length: bytes.len() });
    }
    Ok(taxels.iter().map(|taxel| Some(*taxel).filter(|[x, y]| !(x + y).is_nan())).collect())
}

fn feature_to_bytes(feature: &[f64]) -> Vec<u8> {
    feature.iter().flat_map(|value| value.to_le_bytes()).collect()
}

fn floats(bytes: &[u8]) -> Result<Vec<f64>, RecordError> {
    let (values, rest) = bytes.as_chunks::<8>();
    if !rest.is_empty() {
        let consumed = bytes.len() - rest.len();
        return Err(RecordError::Trailing { consumed, length: bytes.len() });
    }
    Ok(values.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect())
}
