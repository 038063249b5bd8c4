//! Snapshots: a whole database after one commit, as one stream of bytes.
//!
//! The form is Palpate's own and independent of the engine: a header, every pair in ascending
//! order, and at the end counts and a hash of everything before; `docs/formats.md` draws it.
//! A truncated stream has no end and is refused. The input is hostile until its end is
//! reached: lengths are bounded before anything is allocated, and nothing is a path.

mod reading;
mod writing;

use std::collections::BTreeMap;

use thiserror::Error;

use crate::engine::EngineError;
pub use reading::{KeysFrom, keys, restore, verify};
pub use writing::SnapshotWriter;

/// The first bytes of a snapshot.
pub const MAGIC: [u8; 8] = *b"PLPTSNAP";
/// Form of new snapshots.
pub const FORM: u32 = 1;
/// Maximum length of the creator's name, bytes.
const MADE_BY_BYTES_MAX: usize = 200;
/// Tag of a pair.
const PAIR: u8 = 1;
/// Tag of the end.
const END: u8 = 2;

/// Header of a snapshot.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SnapshotHeader {
    /// Layout of its keys and records.
    pub layout: u32,
    /// Time of its start, milliseconds since 1970.
    pub created_at_ms: u64,
    /// Creator.
    pub made_by: String,
}

/// Content of a complete snapshot.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SnapshotManifest {
    /// Its header.
    pub header: SnapshotHeader,
    /// Number of pairs in each space, by its letter.
    pub pairs: BTreeMap<u8, u64>,
    /// Total bytes of all keys and values.
    pub bytes: u64,
    /// BLAKE3 hash of everything before it.
    pub hash: [u8; 32],
}

/// Error of a snapshot that was not read.
#[derive(Debug, Error)]
pub enum SnapshotError {
    /// The source cannot be read.
    #[error("cannot read the snapshot: {0}")]
    Io(std::io::Error),
    /// The snapshot is truncated.
    #[error("the snapshot is cut off after {at} bytes: it was not written to its end")]
    CutOff {
        /// Its length in bytes.
        at: u64,
    },
    /// It does not begin with the magic number.
    #[error("this is no snapshot: it does not begin with {:?}", "PLPTSNAP")]
    Magic,
    /// It was written by a newer Palpate.
    #[error("the snapshot has form {found}, this version of Palpate knows {FORM}")]
    Form {
        /// Its form.
        found: u32,
    },
    /// Its layout is newer than this Palpate.
    #[error(
        "the snapshot has layout {found}, this version of Palpate knows up to {known}: use a \
         newer version"
    )]
    TooNew {
        /// Its layout.
        found: u32,
        /// Newest known layout.
        known: u32,
    },
    /// A part of it is invalid.
    #[error("the snapshot is damaged at byte {at}: {fault}")]
    Damaged {
        /// Position in bytes.
        at: u64,
        /// The fault.
        fault: &'static str,
    },
    /// The target of the restoration is not empty.
    #[error("the database is not empty: restore a snapshot into an empty one")]
    NotEmpty,
    /// The engine failed.
    #[error(transparent)]
    Engine(#[from] EngineError),
}
