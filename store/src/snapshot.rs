//! Snapshots: a whole database as one stream of bytes, as it was after one commit.
//!
//! The form is Palpate's own and does not depend on the engine: a header, every pair in
//! ascending order, and at the end counts and a hash of all that is before; `docs/formats.md`
//! draws it. A stream that was cut off has no end and is refused. What is read is hostile until
//! its end is reached: lengths are bounded before anything is allocated, nothing is a path.

mod reading;
mod writing;

use std::collections::BTreeMap;

use thiserror::Error;

use crate::engine::EngineError;
pub use reading::{KeysFrom, keys, restore, verify};
pub use writing::SnapshotWriter;

/// The first bytes of a snapshot.
pub const MAGIC: [u8; 8] = *b"PLPTSNAP";
/// The form that is written.
pub const FORM: u32 = 1;
/// No name of who made it is longer, in bytes.
const MADE_BY_BYTES_MAX: usize = 200;
/// Begins a pair.
const PAIR: u8 = 1;
/// Begins the end.
const END: u8 = 2;

/// What a snapshot says of itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SnapshotHeader {
    /// The layout of the keys and records in it.
    pub layout: u32,
    /// When it was begun, milliseconds since 1970.
    pub created_at_ms: u64,
    /// Who made it.
    pub made_by: String,
}

/// What a whole snapshot holds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SnapshotManifest {
    /// What it says of itself.
    pub header: SnapshotHeader,
    /// How many pairs there are in each space, by its letter.
    pub pairs: BTreeMap<u8, u64>,
    /// How many bytes all keys and values have.
    pub bytes: u64,
    /// The blake3 hash of everything before it.
    pub hash: [u8; 32],
}

/// Why a snapshot was not read.
#[derive(Debug, Error)]
pub enum SnapshotError {
    /// It cannot be read.
    #[error("cannot read the snapshot: {0}")]
    Io(std::io::Error),
    /// It ends before its end.
    #[error("the snapshot is cut off after {at} bytes: it was not written to its end")]
    CutOff {
        /// How many bytes there are.
        at: u64,
    },
    /// It does not begin as one.
    #[error("this is no snapshot: it does not begin with {:?}", "PLPTSNAP")]
    Magic,
    /// It was written by a newer Palpate.
    #[error("the snapshot has form {found}, this version of Palpate knows {FORM}")]
    Form {
        /// Its form.
        found: u32,
    },
    /// Its layout is newer than what this Palpate knows.
    #[error(
        "the snapshot has layout {found}, this version of Palpate knows up to {known}: use a \
         newer version"
    )]
    TooNew {
        /// Its layout.
        found: u32,
        /// The newest that is known.
        known: u32,
    },
    /// Something in it is not as it must be.
    #[error("the snapshot is damaged at byte {at}: {fault}")]
    Damaged {
        /// Where.
        at: u64,
        /// What is wrong.
        fault: &'static str,
    },
    /// There is something already where it is to be restored.
    #[error("the database is not empty: restore a snapshot into an empty one")]
    NotEmpty,
    /// The engine failed.
    #[error(transparent)]
    Engine(#[from] EngineError),
}
