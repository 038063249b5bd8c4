//! What can go wrong in the repositories.

use palpate_core::pose::PoseError;
use palpate_core::sensor::SensorError;
use palpate_core::sensor::calibration::CalibrationError;
use thiserror::Error;
use uuid::Uuid;

use crate::engine::{CommitError, EngineError};
use crate::envelope::EnvelopeError;
use crate::key::Space;
use crate::model_codec::CodecError;

/// Why stored bytes are not the record they should be.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum RecordError {
    /// The envelope is damaged or of another kind.
    #[error(transparent)]
    Envelope(#[from] EnvelopeError),
    /// The record was written by a newer Palpate.
    #[error("record has schema {found}, this version of Palpate knows up to {known}")]
    Schema {
        /// The schema number found.
        found: u16,
        /// The newest that is known.
        known: u16,
    },
    /// The payload does not decode.
    #[error("record does not decode: {detail}")]
    Decode {
        /// What the decoder said.
        detail: String,
    },
    /// The payload goes on behind the record.
    #[error("record ends after {consumed} of {length} bytes")]
    Trailing {
        /// What the record needs.
        consumed: usize,
        /// What is there.
        length: usize,
    },
    /// A number stands for nothing.
    #[error("{field} is {found}, which stands for nothing")]
    Code {
        /// The field.
        field: &'static str,
        /// The number.
        found: u8,
    },
    /// A pose is not one.
    #[error(transparent)]
    Pose(#[from] PoseError),
    /// A sensor's numbers do not describe one.
    #[error(transparent)]
    Sensor(#[from] SensorError),
    /// A calibration's numbers are none.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
    /// A piece of a large record is missing.
    #[error("piece {piece} of the record is missing")]
    Piece {
        /// Its number, from 1.
        piece: u32,
    },
    /// The content does not have the hash it is known by.
    #[error("content has hash {found}, expected {expected}")]
    Hash {
        /// The hash it is known by, in hexadecimal.
        expected: String,
        /// The hash of what is there.
        found: String,
    },
    /// A journal has a gap.
    #[error("entry {seq} of {length} is missing")]
    Entry {
        /// The sequence number that is missing.
        seq: u64,
        /// How many entries there should be.
        length: u64,
    },
}

/// Why a repository did not do what it was asked.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum StoreError {
    /// Nothing has this id.
    #[error("{what} {id} does not exist")]
    NotFound {
        /// What was looked for.
        what: &'static str,
        /// Its id.
        id: Uuid,
    },
    /// The id is taken.
    #[error("{what} {id} exists already")]
    Exists {
        /// What was to be created.
        what: &'static str,
        /// Its id.
        id: Uuid,
    },
    /// The name is taken.
    #[error("the name {name:?} is taken by another {what}")]
    NameTaken {
        /// What was to be named.
        what: &'static str,
        /// The name.
        name: String,
    },
    /// Others kept changing the same thing, or it is not as it was expected.
    #[error("{what} {id} was changed by someone else at the same time")]
    Changed {
        /// What was to be changed.
        what: &'static str,
        /// Its id.
        id: Uuid,
    },
    /// A catalogue has no such version.
    #[error("catalogue {catalogue} has no version {version}")]
    NoVersion {
        /// The catalogue.
        catalogue: Uuid,
        /// The version asked for.
        version: u32,
    },
    /// Stored bytes are damaged.
    #[error("stored {space:?} record is damaged: {source}")]
    Damaged {
        /// Where it lies.
        space: Space,
        /// What is wrong.
        source: RecordError,
    },
    /// A catalogue's blocks are whole but do not make a model.
    #[error("version {version} of catalogue {catalogue} is not a model: {source}")]
    Model {
        /// The catalogue.
        catalogue: Uuid,
        /// The version.
        version: u32,
        /// What does not fit.
        source: CodecError,
    },
    /// The engine failed or is overloaded.
    #[error(transparent)]
    Engine(#[from] EngineError),
}

impl StoreError {
    /// The damage of a record in `space`.
    pub(crate) fn damaged(space: Space) -> impl Fn(RecordError) -> Self {
        move |source| Self::Damaged { space, source }
    }
}

/// Splits a commit's error: which expectation does not hold, or what the engine said.
pub(crate) fn conflict(error: CommitError) -> Result<usize, EngineError> {
    match error {
        CommitError::Conflict { expectation } => Ok(expectation),
        CommitError::Engine(error) => Err(error),
    }
}

/// What went wrong with a commit that expects nothing.
pub(crate) fn unconditional(error: CommitError) -> EngineError {
    match error {
        CommitError::Engine(error) => error,
        CommitError::Conflict { .. } => unreachable!("the commit expects nothing"),
    }
}
