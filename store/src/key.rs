//! The key layout, drawn in `docs/formats.md`.
//!
//! A key is one letter for its space, then fixed-width big-endian parts, so that keys sort as
//! their numbers do and a prefix is a query ("all readings of this session"). Only names and
//! robots have variable length; both come last or carry their length.

use uuid::Uuid;

/// A space of keys, by its letter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Space {
    /// The layout number of the whole database.
    Layout = b'!',
    /// Sensors by id.
    Sensor = b's',
    /// Objects by id.
    Object = b'o',
    /// Unique names of sensors, objects and catalogues, to ids.
    Name = b'n',
    /// Metadata of an object's mesh, by object.
    Mesh = b'm',
    /// A mesh's file, by object and upload.
    MeshFile = b'f',
    /// Length of an object's training journal.
    TrainingHead = b'T',
    /// Training readings, by object and sequence.
    Training = b't',
    /// Robots' own numbers of training readings.
    TrainingRobot = b'u',
    /// Jobs by id.
    Job = b'j',
    /// Sessions by id.
    Session = b'e',
    /// Length of a session's journal.
    JournalHead = b'R',
    /// Session journals, by session and sequence.
    Journal = b'r',
    /// Robots' own numbers of session readings.
    JournalRobot = b'w',
    /// Retractions in session journals, by session and sequence.
    JournalRetraction = b'x',
    /// Catalogues by id.
    Catalogue = b'c',
    /// Manifests of catalogue versions, by catalogue and number.
    Version = b'v',
    /// Calibrations, by sensor and number from 1.
    Calibration = b'k',
    /// Days of sensors, by sensor and days since 1970-01-01.
    SensorDay = b'i',
    /// Immutable blocks, by the hash of their content.
    Block = b'b',
    /// API keys by id.
    AccessKey = b'a',
    /// Changes in the audit log, by sequence.
    Audit = b'l',
    /// Refused requests with a key in the audit log, by sequence.
    AuditRefused = b'd',
    /// Refused requests without a key in the audit log, by sequence.
    AuditStrangers = b'q',
    /// The last number in an audit log that several servers write.
    AuditHead = b'A',
    /// The API key that owns a robot's name, by name.
    RobotHolder = b'h',
    /// Webhooks by id.
    Webhook = b'W',
    /// Deliveries, by webhook and event.
    Delivery = b'D',
    /// What was announced of sessions, by session.
    Notice = b'N',
    /// The latest time.
    Clock = b'y',
    /// Bytes of a thing that an API key wrote, by thing and key.
    Holding = b'z',
}

/// The bytes of an id inside a key: the space's letter and 16 bytes.
pub const ID_KEY_BYTES: usize = 17;

/// All keys of a space.
#[must_use]
pub fn space(space: Space) -> Vec<u8> {
    vec![space as u8]
}

/// The key of an id, and the prefix of the records under it.
#[must_use]
pub fn id(space: Space, id: Uuid) -> Vec<u8> {
    [&[space as u8], &id.as_bytes()[..]].concat()
}

/// The key of a number under an id.
#[must_use]
pub fn numbered(space: Space, owner: Uuid, number: u64) -> Vec<u8> {
    [&id(space, owner)[..], &number.to_be_bytes()].concat()
}

/// The key of an id under an id.
#[must_use]
pub fn nested(space: Space, owner: Uuid, inner: Uuid) -> Vec<u8> {
    [&id(space, owner)[..], inner.as_bytes()].concat()
}

/// The key of a content hash.
#[must_use]
pub fn hash(space: Space, hash: &[u8; 32]) -> Vec<u8> {
    [&[space as u8], &hash[..]].concat()
}

/// The key of a unique name; `kind` is the space of the named ids.
#[must_use]
pub fn name(kind: Space, name: &str) -> Vec<u8> {
    [&[Space::Name as u8, kind as u8], name.as_bytes()].concat()
}

/// The key of a robot's own number under an id, among those written with an API key; without
/// one, among those of unknown key. `robot` has at most 64 bytes.
#[must_use]
pub fn robot(
    space: Space,
    owner: Uuid,
    robot: &str,
    seq: u64,
    written_by: Option<Uuid>,
) -> Vec<u8> {
    let length = u8::try_from(robot.len()).unwrap_or(u8::MAX);
    let written_by = written_by.as_ref().map_or(&[][..], |key| key.as_bytes());
    let (owner, seq) = (id(space, owner), seq.to_be_bytes());
    [&owner[..], &[length], robot.as_bytes(), &seq, written_by].concat()
}

/// The key of a robot's name in the fleet. `robot` has at most 64 bytes.
#[must_use]
pub fn robot_name(robot: &str) -> Vec<u8> {
    [&[Space::RobotHolder as u8], robot.as_bytes()].concat()
}

/// The key of piece `piece` (from 1) of the value that begins under `head`.
#[must_use]
pub fn piece(head: &[u8], piece: u32) -> Vec<u8> {
    [head, &piece.to_be_bytes()].concat()
}
