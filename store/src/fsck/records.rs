//! Check of single records: pieces assembled, envelopes opened, payloads decoded.

use uuid::Uuid;

use super::relations::Relations;
use super::{Finding, Report, Severity};
use crate::access::AccessKey;
use crate::audit::{AuditEntry, AuditHeadV1};
use crate::calibration::StoredCalibration;
use crate::catalogue::{Catalogue, Manifest};
use crate::engine::VALUE_BYTES_MAX;
use crate::entity::{Job, Object, Sensor, Session};
use crate::envelope::{self, HEADER_BYTES, Kind};
use crate::holding;
use crate::journal::{Entry, JournalRetractionV1, JournalRobotV1, StoredHead};
use crate::key;
use crate::mesh::MeshInfo;
use crate::record::{self, LayoutV1, NameV1, Record};
use crate::robot::RobotHolder;
use crate::running::Clock;
use crate::sensor_day::SensorDay;
use crate::webhook::{Delivery, Notice, Webhook};

/// A complete, undamaged record.
pub(super) enum Whole {
    Layout(LayoutV1),
    Sensor(Sensor),
    Object(Object),
    Name(NameV1),
    Mesh(MeshInfo),
    Head(StoredHead),
    Entry(Entry),
    Robot(JournalRobotV1),
    Retraction(JournalRetractionV1),
    Session(Session),
    Catalogue(Catalogue),
    Version(Manifest),
    Calibration(StoredCalibration),
    SensorDay(SensorDay),
    /// A file or block: its hash and length.
    Raw([u8; 32], u64),
    /// A file or block whose content was not read: its length.
    Unread(u64),
    /// Bytes that a key wrote of a thing.
    Holding,
    /// A job, a key, a webhook, a delivery, or an entry of the audit log: no other record refers to
    /// it.
    Alone,
    /// A complete record of a kind that later versions added.
    Other,
}

/// The value of a pair.
pub(super) enum Value<'pair> {
    Read(&'pair [u8]),
    /// Not read: its length.
    Elsewhere(usize),
}

/// Name and key length (`None` is any) of the records of a space, and the consequence of damage.
pub(super) fn space(letter: u8) -> (&'static str, Option<usize>, &'static str) {
    match letter {
        b'!' => ("layout", Some(1), "the database does not open"),
        b's' => ("sensor", Some(17), "readings of this sensor cannot be used"),
        b'o' => ("object", Some(17), "the object is not listed and cannot be trained"),
        b'n' => ("name", None, "it is not found by its name"),
        b'm' => ("mesh", Some(17), "the object cannot be trained from its mesh"),
        b'f' => ("mesh file", Some(33), "the object cannot be trained from its mesh"),
        b'T' => ("training head", Some(17), "the object's training readings are not found"),
        b't' => ("training entry", Some(25), "the object cannot be trained from its readings"),
        b'u' => ("training robot", None, "a repeated training reading is not recognised"),
        b'j' => ("job", Some(17), "the job cannot be shown"),
        b'e' => ("session", Some(17), "the session cannot be used"),
        b'R' => ("journal head", Some(17), "the session's readings are not found"),
        b'r' => ("journal entry", Some(25), "the session has no belief any more"),
        b'w' => ("journal robot", None, "a repeated reading is not recognised"),
        b'x' => {
            ("journal retraction", Some(25), "a withdrawn reading is listed as one that counts")
        }
        b'c' => ("catalogue", Some(17), "the catalogue and its versions are not found"),
        b'v' => ("version", Some(25), "the version cannot be recognised with"),
        b'k' => ("calibration", Some(25), "readings that it applies to cannot be used"),
        b'i' => ("sensor day", Some(25), "the sensor's health cannot be told"),
        b'b' => ("block", Some(33), "versions with it cannot be recognised with"),
        b'a' => ("key", Some(17), "whoever holds the key is not let in"),
        b'y' => ("clock", Some(1), "a key that has expired is let in when the clock is set back"),
        b'A' => ("audit head", Some(1), "servers on one cluster number audit entries anew"),
        b'h' => ("robot", None, "the robot's name belongs to nobody"),
        b'z' => ("holding", None, "the bytes that a key holds are counted wrong"),
        b'W' => ("webhook", Some(17), "it receives no events"),
        b'D' => ("delivery", Some(33), "the event is not delivered"),
        b'N' => ("notice", Some(17), "events of the session may be sent again"),
        b'l' | b'd' | b'q' => ("audit entry", Some(9), "the audit log lacks the entry"),
        _ => ("other", None, "it is not known to this version of Palpate"),
    }
}

/// A key in words.
pub(super) fn words(key: &[u8]) -> String {
    let id = |from: usize| {
        let bytes = key.get(from..from + 16).and_then(|bytes| <[u8; 16]>::try_from(bytes).ok());
        bytes.map_or_else(|| hex(key), |bytes| Uuid::from_bytes(bytes).to_string())
    };
    let number = |from: usize| {
        let bytes = key.get(from..from + 8).and_then(|bytes| <[u8; 8]>::try_from(bytes).ok());
        bytes.map_or(0, u64::from_be_bytes)
    };
    match (key.first(), key.len()) {
        (Some(b'!' | b'y' | b'A'), 1) => "of the whole".to_owned(),
        (
            Some(b's' | b'o' | b'm' | b'T' | b'j' | b'e' | b'R' | b'c' | b'a' | b'W' | b'N'),
            17..,
        ) => id(1),
        (Some(b't' | b'r' | b'x'), 25..) => format!("{} entry {}", id(1), number(17)),
        (Some(b'v' | b'k' | b'i'), 25..) => format!("{} number {}", id(1), number(17)),
        (Some(b'l' | b'd' | b'q'), 9..) => format!("number {}", number(1)),
        (Some(b'f'), 33..) => format!("{} upload {}", id(1), id(17)),
        (Some(b'D'), 33..) => format!("{} event {}", id(1), id(17)),
        (Some(b'n'), 2..) => String::from_utf8_lossy(&key[1..]).into_owned(),
        (Some(b'z'), 18..) => {
            let (thing, account) = (&key[1..key.len() - 16], key.len() - 16);
            format!("{} {} of key {}", space(thing[0]).0, words(thing), id(account))
        }
        (Some(b'h'), 2..) => String::from_utf8_lossy(&key[1..]).into_owned(),
        (Some(b'u' | b'w'), 26..) => {
            let end = (18 + usize::from(key[17])).min(key.len() - 8);
            let robot = String::from_utf8_lossy(&key[18..end]);
            let by = if key.len() == end + 24 {
                format!(" of key {}", id(end + 8))
            } else {
                String::new()
            };
            format!("{} robot {robot:?} number {}{by}", id(1), number(end))
        }
        _ => hex(key),
    }
}

/// The record whose pieces are being read.
#[derive(Default)]
pub(super) struct Assembly {
    head: Vec<u8>,
    total: usize,
    found: usize,
    next_piece: u32,
    fault: Option<String>,
    /// Whether a piece is elsewhere and was not read.
    is_elsewhere: bool,
    /// The bytes; only the header for files and blocks.
    bytes: Vec<u8>,
    content: blake3::Hasher,
    checksum: crc32fast::Hasher,
}

impl Assembly {
    /// Takes a pair, or a key whose value was not read.
    pub(super) fn pair(
        &mut self,
        key: &[u8],
        value: &Value<'_>,
        relations: &mut Relations,
        report: &mut Report,
    ) {
        let (name, head_bytes, _) = space(key[0]);
        let is_piece = match head_bytes {
            Some(length) => key.len() == length + 4,
            // A record of an unknown kind: the previous record may be incomplete.
            None => self.lacks(key),
        };
        if !is_piece {
            self.end(relations, report);
            let is_odd = head_bytes.is_some_and(|length| key.len() != length);
            if is_odd {
                report.add(damage(key, "its key has a length that no key has".to_owned()));
                return;
            }
            *report.records.entry(name).or_default() += 1;
            return self.begin(key, value);
        }
        let head = &key[..key.len() - 4];
        if self.head != head {
            self.end(relations, report);
            // Pieces without a first one were never acknowledged.
            relations.leftover(head, "pieces without a first one".to_owned(), report);
            self.head.clear();
            return;
        }
        if key != key::piece(head, self.next_piece) && self.fault.is_none() {
            self.fault = Some(format!("piece {} is missing", self.next_piece));
        }
        self.next_piece += 1;
        match value {
            Value::Read(value) => self.take(value),
            Value::Elsewhere(length) => self.skip(*length),
        }
    }

    fn lacks(&self, key: &[u8]) -> bool {
        let is_behind = key.len() == self.head.len() + 4 && key.starts_with(&self.head);
        !self.head.is_empty() && is_behind && self.found < self.total
    }

    fn begin(&mut self, key: &[u8], value: &Value<'_>) {
        *self = Self { head: key.to_vec(), next_piece: 1, ..Self::default() };
        let value = match value {
            Value::Read(value) => *value,
            Value::Elsewhere(length) => return self.skip(*length),
        };
        match envelope::total_bytes(value) {
            Ok(total) => self.total = total,
            Err(error) => self.fault = Some(error.to_string()),
        }
        if is_raw(key[0]) && value.len() >= HEADER_BYTES {
            self.bytes.extend_from_slice(&value[..HEADER_BYTES]);
            self.checksum.update(&value[..HEADER_BYTES - 4]);
            self.found = HEADER_BYTES;
            self.take(&value[HEADER_BYTES..]);
        } else {
            self.take(value);
        }
    }

    fn skip(&mut self, length: usize) {
        self.found += length;
        self.is_elsewhere = true;
    }

    fn take(&mut self, value: &[u8]) {
        self.found += value.len();
        if value.len() > VALUE_BYTES_MAX {
            self.fault = Some(format!("a piece of {} bytes", value.len()));
        }
        if self.head.first().is_some_and(|letter| is_raw(*letter)) {
            self.content.update(value);
            self.checksum.update(value);
        } else if self.found <= self.total.max(VALUE_BYTES_MAX) {
            self.bytes.extend_from_slice(value);
        }
    }

    /// Checks the record whose pieces are complete.
    pub(super) fn end(&mut self, relations: &mut Relations, report: &mut Report) {
        let done = std::mem::take(self);
        if done.head.is_empty() {
            return;
        }
        let key = done.head.clone();
        match done.opened() {
            Ok(whole) => relations.record(&key, whole, report),
            Err(fault) => {
                relations.damaged(&key, &fault);
                report.add(damage(&key, fault));
            }
        }
    }

    fn opened(self) -> Result<Whole, String> {
        if let Some(fault) = self.fault {
            return Err(fault);
        }
        // The first piece has the total; it may be elsewhere, too.
        let is_known = !self.is_elsewhere || self.total > 0;
        if is_known && self.found != self.total {
            return Err(format!("it has {} bytes of {}", self.found, self.total));
        }
        if self.is_elsewhere {
            return Ok(Whole::Unread(self.found.saturating_sub(HEADER_BYTES) as u64));
        }
        let bytes = &self.bytes;
        match self.head[0] {
            b'!' => decoded(bytes, Whole::Layout),
            b's' => decoded(bytes, Whole::Sensor),
            b'o' => decoded(bytes, Whole::Object),
            b'n' => decoded(bytes, Whole::Name),
            b'm' => decoded(bytes, Whole::Mesh),
            b'j' => decoded(bytes, |_: Job| Whole::Alone),
            b'T' | b'R' => decoded(bytes, Whole::Head),
            b't' | b'r' => decoded(bytes, Whole::Entry),
            b'u' | b'w' => decoded(bytes, Whole::Robot),
            b'x' => decoded(bytes, Whole::Retraction),
            b'e' => decoded(bytes, Whole::Session),
            b'c' => decoded(bytes, Whole::Catalogue),
            b'v' => decoded(bytes, Whole::Version),
            b'k' => decoded(bytes, Whole::Calibration),
            b'i' => decoded(bytes, Whole::SensorDay),
            b'a' => decoded(bytes, |_: AccessKey| Whole::Alone),
            b'y' => decoded(bytes, |_: Clock| Whole::Alone),
            b'A' => decoded(bytes, |_: AuditHeadV1| Whole::Alone),
            b'h' => decoded(bytes, |_: RobotHolder| Whole::Alone),
            b'l' | b'd' | b'q' => decoded(bytes, |_: AuditEntry| Whole::Alone),
            b'W' => decoded(bytes, |_: Webhook| Whole::Alone),
            b'D' => decoded(bytes, |_: Delivery| Whole::Alone),
            b'N' => decoded(bytes, |_: Notice| Whole::Alone),
            b'z' => {
                holding::bytes(bytes).map(|_| Whole::Holding).map_err(|error| error.to_string())
            }
            b'f' => self.raw(Kind::MeshFile),
            b'b' => self.raw(Kind::Block),
            _ => envelope::open_any(bytes).map(|_| Whole::Other).map_err(|error| error.to_string()),
        }
    }

    fn raw(&self, kind: Kind) -> Result<Whole, String> {
        let number = |at: usize| u16::from_le_bytes([self.bytes[at], self.bytes[at + 1]]);
        let stated =
            u32::from_le_bytes([self.bytes[16], self.bytes[17], self.bytes[18], self.bytes[19]]);
        let found = self.checksum.clone().finalize();
        if stated != found {
            return Err(format!("it has checksum {found:08x}, expected {stated:08x}"));
        }
        if number(4) != kind as u16 {
            return Err(format!("it is of kind {}, expected {kind:?}", number(4)));
        }
        let length = (self.found - HEADER_BYTES) as u64;
        Ok(Whole::Raw(*self.content.finalize().as_bytes(), length))
    }
}

/// Damage of the record under `key`.
pub(super) fn damage(key: &[u8], fault: String) -> Finding {
    let (space, _, means) = space(key[0]);
    Finding { severity: Severity::Damage, space, key: words(key), fault, means }
}

fn decoded<T: Record>(bytes: &[u8], whole: impl FnOnce(T) -> Whole) -> Result<Whole, String> {
    record::decode(bytes).map(whole).map_err(|error| error.to_string())
}

fn is_raw(letter: u8) -> bool {
    matches!(letter, b'f' | b'b')
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
