//! Errors of the repositories.

use palpate_core::pose::PoseError;
use palpate_core::sensor::SensorError;
use palpate_core::sensor::calibration::CalibrationError;
use palpate_core::sensor::passport::PassportError;
use palpate_core::sensor::response_curve::ResponseCurveError;
use thiserror::Error;
use uuid::Uuid;

use crate::engine::{CommitError, EngineError};
use crate::envelope::EnvelopeError;
use crate::key::Space;
use crate::model_codec::CodecError;

/// Error of stored bytes that are not the expected record.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum RecordError {
    /// The envelope is damaged or of another kind.
    #[error(transparent)]
    Envelope(#[from] EnvelopeError),
    /// The record was written by a newer Palpate.
    #[error("record has schema {found}, this version of Palpate knows up to {known}")]
    Schema {
        /// Schema number of the record.
        found: u16,
        /// Newest known schema number.
        known: u16,
    },
    /// The payload cannot be decoded.
    #[error("record does not decode: {detail}")]
    Decode {
        /// The decoder's message.
        detail: String,
    },
    /// There are bytes after the end of the record.
    #[error("record ends after {consumed} of {length} bytes")]
    Trailing {
        /// Length of the record.
        consumed: usize,
        /// Length of the payload.
        length: usize,
    },
    /// A code is not defined.
    #[error("{field} is {found}, which stands for nothing")]
    Code {
        /// The field's name.
        field: &'static str,
        /// The code.
        found: u8,
    },
    /// The numbers are not a pose.
    #[error(transparent)]
    Pose(#[from] PoseError),
    /// The numbers do not describe a sensor.
    #[error(transparent)]
    Sensor(#[from] SensorError),
    /// The numbers are not a calibration.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
    /// Stored knots are not a response curve.
    #[error(transparent)]
    ResponseCurve(#[from] ResponseCurveError),
    /// The numbers are not a passport.
    #[error(transparent)]
    Passport(#[from] PassportError),
    /// A piece of a large record is missing.
    #[error("piece {piece} of the record is missing")]
    Piece {
        /// Number of the piece, from 1.
        piece: u32,
    },
    /// The content does not have the expected hash.
    #[error("content has hash {found}, expected {expected}")]
    Hash {
        /// Expected hash, in hexadecimal.
        expected: String,
        /// Hash of the content.
        found: String,
    },
    /// A journal has a gap.
    #[error("entry {seq} of {length} is missing")]
    Entry {
        /// Sequence number of the missing entry.
        seq: u64,
        /// Expected number of entries.
        length: u64,
    },
}

/// Error of a repository's operation.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum StoreError {
    /// No item has this id.
    #[error("{what} {id} does not exist")]
    NotFound {
        /// Kind of the item.
        what: &'static str,
        /// The id.
        id: Uuid,
    },
    /// The id is in use.
    #[error("{what} {id} exists already")]
    Exists {
        /// Kind of the new item.
        what: &'static str,
        /// The id.
        id: Uuid,
    },
    /// The name is in use.
    #[error("the name {name:?} is taken by another {what}")]
    NameTaken {
        /// Kind of the item.
        what: &'static str,
        /// The name.
        name: String,
    },
    /// The item was changed concurrently, or has another state than expected.
    #[error("{what} {id} was changed by someone else at the same time")]
    Changed {
        /// Kind of the item.
        what: &'static str,
        /// The id.
        id: Uuid,
    },
    /// The catalogue has no such version.
    #[error("catalogue {catalogue} has no version {version}")]
    NoVersion {
        /// The catalogue.
        catalogue: Uuid,
        /// The requested version.
        version: u32,
    },
    /// Stored bytes are damaged.
    #[error("stored {space:?} record is damaged: {source}")]
    Damaged {
        /// Space of the record.
        space: Space,
        /// The fault.
        source: RecordError,
    },
    /// The blocks of a version are undamaged but inconsistent.
    #[error("version {version} of catalogue {catalogue} is not a model: {source}")]
    Model {
        /// The catalogue.
        catalogue: Uuid,
        /// The version.
        version: u32,
        /// The fault.
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

/// Splits a commit's error: the index of the failed expectation, or the engine's error.
pub(crate) fn conflict(error: CommitError) -> Result<usize, EngineError> {
    match error {
        CommitError::Conflict { expectation } => Ok(expectation),
        CommitError::Engine(error) => Err(error),
    }
}

/// The error of a commit without expectations.
pub(crate) fn unconditional(error: CommitError) -> EngineError {
    match error {
        CommitError::Engine(error) => error,
        CommitError::Conflict { .. } => unreachable!("the commit expects nothing"),
    }
}
