//! The envelope of every stored record: kind, schema, length and checksum.
//!
//! 20 bytes, little-endian: magic "PLPT", kind u16, schema u16, flags u32, length u32, CRC-32
//! of the first 16 bytes and the payload. The reader checks the kind it expects, so a record
//! under the wrong key is found too. No flags are defined; a record with any set comes from a
//! newer Palpate and is refused.

use thiserror::Error;

/// The first four bytes of every record.
pub const MAGIC: [u8; 4] = *b"PLPT";
/// Length of the header, bytes.
pub const HEADER_BYTES: usize = 20;
/// Maximum length of a payload.
pub const PAYLOAD_BYTES_MAX: usize = 1 << 30;

/// Kind of a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u16)]
pub enum Kind {
    /// The layout of the whole database.
    Layout = 1,
    /// A sensor.
    Sensor = 2,
    /// An object.
    Object = 3,
    /// A name's id.
    Name = 4,
    /// Metadata of a mesh.
    Mesh = 5,
    /// A mesh file, raw.
    MeshFile = 6,
    /// Length of a journal.
    JournalHead = 7,
    /// A journal's entry.
    JournalEntry = 8,
    /// Position in a journal of a robot's reading number.
    JournalRobot = 9,
    /// A job.
    Job = 10,
    /// A session.
    Session = 11,
    /// A catalogue: its versions and the current one.
    Catalogue = 12,
    /// The manifest of a catalogue's version.
    Version = 13,
    /// A catalogue's block, raw.
    Block = 14,
    /// A calibration of a sensor.
    Calibration = 15,
    /// An API key, without its secret.
    AccessKey = 16,
    /// An entry of the audit log.
    Audit = 17,
    /// The journal entry that withdraws another one.
    JournalRetraction = 20,
    /// The API key that owns a robot's name.
    RobotHolder = 21,
    /// The latest time.
    Clock = 22,
    /// Bytes of a thing that an API key wrote.
    Holding = 23,
    /// What the sessions of a day say about a sensor.
    SensorDay = 25,
    /// A webhook, with its secret.
    Webhook = 26,
    /// An event for a webhook.
    Delivery = 27,
    /// What was announced of a session.
    Notice = 28,
    /// Number of commits, and the sum of all records.
    Tally = 30,
    /// The last number in an audit log that several servers write.
    AuditHead = 31,
}

/// A checked envelope.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Opened<'bytes> {
    /// Schema number of the payload.
    pub schema: u16,
    /// The payload.
    pub payload: &'bytes [u8],
}

/// Error of bytes that are not the expected record.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum EnvelopeError {
    /// The bytes are too few or too many.
    #[error("record has {found} bytes, expected {expected}")]
    Length {
        /// Length according to the header, or the header's own length.
        expected: usize,
        /// Length found.
        found: usize,
    },
    /// The bytes do not begin with the magic number.
    #[error("record begins with {found:02x?}, expected {MAGIC:02x?}")]
    Magic {
        /// The first four bytes.
        found: [u8; 4],
    },
    /// The checksum does not match.
    #[error("record has checksum {found:08x}, expected {expected:08x}: it is damaged")]
    Checksum {
        /// Checksum in the header.
        expected: u32,
        /// Checksum of the bytes.
        found: u32,
    },
    /// The record is of another kind.
    #[error("record is of kind {found}, expected {expected:?}")]
    Kind {
        /// Expected kind.
        expected: Kind,
        /// Number of the kind in the header.
        found: u16,
    },
    /// The record was written by a newer Palpate.
    #[error("record has flags {found:#x}, which this version of Palpate does not know")]
    Flags {
        /// The flags in the header.
        found: u32,
    },
}

/// Wraps a payload of at most [`PAYLOAD_BYTES_MAX`] bytes.
///
/// # Panics
/// When the payload is larger; the repositories check sizes where data enters.
#[must_use]
pub fn seal(kind: Kind, schema: u16, payload: &[u8]) -> Vec<u8> {
    assert!(payload.len() <= PAYLOAD_BYTES_MAX, "payloads are bounded where they come in");
    let mut bytes = Vec::with_capacity(HEADER_BYTES + payload.len());
    bytes.extend_from_slice(&MAGIC);
    bytes.extend_from_slice(&(kind as u16).to_le_bytes());
    bytes.extend_from_slice(&schema.to_le_bytes());
    bytes.extend_from_slice(&0u32.to_le_bytes());
    bytes.extend_from_slice(&(payload.len() as u32).to_le_bytes());
    let checksum = checksum(&bytes, payload);
    bytes.extend_from_slice(&checksum.to_le_bytes());
    bytes.extend_from_slice(payload);
    bytes
}

/// Checks an envelope of the `expected` kind and returns its content.
///
/// # Errors
/// [`EnvelopeError`] names the fault; a single flipped byte is always detected.
pub fn open(expected: Kind, bytes: &[u8]) -> Result<Opened<'_>, EnvelopeError> {
    let (kind, opened) = open_any(bytes)?;
    if kind != expected as u16 {
        return Err(EnvelopeError::Kind { expected, found: kind });
    }
    Ok(opened)
}

/// Checks an envelope of any kind, even an unknown one, and returns the kind's number and the
/// content.
///
/// # Errors
/// As [`open`].
pub fn open_any(bytes: &[u8]) -> Result<(u16, Opened<'_>), EnvelopeError> {
    let total = total_bytes(bytes)?;
    if bytes.len() != total {
        return Err(EnvelopeError::Length { expected: total, found: bytes.len() });
    }
    let payload = &bytes[HEADER_BYTES..];
    let (stated, computed) = (u32_at(bytes, 16), checksum(&bytes[..16], payload));
    if stated != computed {
        return Err(EnvelopeError::Checksum { expected: stated, found: computed });
    }
    let flags = u32_at(bytes, 8);
    if flags != 0 {
        return Err(EnvelopeError::Flags { found: flags });
    }
    Ok((u16_at(bytes, 4), Opened { schema: u16_at(bytes, 6), payload }))
}

/// The length in bytes of the record that begins with `head`, header included.
///
/// # Errors
/// [`EnvelopeError`] when `head` is shorter than a header, does not begin with the magic number,
/// or states an impossible length.
pub fn total_bytes(head: &[u8]) -> Result<usize, EnvelopeError> {
    if head.len() < HEADER_BYTES {
        return Err(EnvelopeError::Length { expected: HEADER_BYTES, found: head.len() });
    }
    let magic = [head[0], head[1], head[2], head[3]];
    if magic != MAGIC {
        return Err(EnvelopeError::Magic { found: magic });
    }
    let payload = u32_at(head, 12) as usize;
    if payload > PAYLOAD_BYTES_MAX {
        return Err(EnvelopeError::Length { expected: payload, found: head.len() });
    }
    Ok(HEADER_BYTES + payload)
}

fn checksum(header: &[u8], payload: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(header);
    hasher.update(payload);
    hasher.finalize()
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}

fn u16_at(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes([bytes[at], bytes[at + 1]])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_envelope_has_its_frozen_bytes() {
        let bytes = seal(Kind::Block, 3, b"ab");
        assert_eq!(bytes[..16], *b"PLPT\x0e\0\x03\0\0\0\0\0\x02\0\0\0");
        assert_eq!(bytes[16..20], crc32fast::hash(&[&bytes[..16], b"ab"].concat()).to_le_bytes());
        assert_eq!(bytes[20..], *b"ab");
        assert_eq!(open(Kind::Block, &bytes), Ok(Opened { schema: 3, payload: b"ab" }));
    }

    #[test]
    fn any_flipped_bit_and_any_truncation_is_found() {
        let bytes = seal(Kind::Sensor, 1, b"a sensor");
        for bit in 0..bytes.len() * 8 {
            let mut damaged = bytes.clone();
            damaged[bit / 8] ^= 1 << (bit % 8);
            assert!(open(Kind::Sensor, &damaged).is_err(), "bit {bit}");
        }
        for length in 0..bytes.len() {
            assert!(open(Kind::Sensor, &bytes[..length]).is_err(), "length {length}");
        }
        assert!(open(Kind::Sensor, &[bytes, vec![0]].concat()).is_err());
    }

    #[test]
    fn a_record_of_another_kind_is_refused() {
        let bytes = seal(Kind::Job, 1, b"");
        let error = open(Kind::Object, &bytes).unwrap_err();
        assert_eq!(error, EnvelopeError::Kind { expected: Kind::Object, found: 10 });
    }
}
