//! Objects of a catalogue, and their surface patches from training.

use thiserror::Error;

/// An object of a catalogue, by its index.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ObjectIdx(pub u32);

/// A trained surface patch, in the object frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MapPatch {
    /// Position, metres.
    pub position: [f32; 3],
    /// Outward normal, norm 1.
    pub normal: [f32; 3],
    /// Constraint of the contact on the normal, 0 to 1.
    pub normal_confidence: f32,
}

/// Minimum number of patches of a map.
pub const MIN_PATCHES: usize = 10;

/// Error of patches that do not make a map.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum MapError {
    /// Too few readings touched the object.
    #[error("{found} training readings touched the object, expected at least {expected}")]
    TooFew {
        /// Number of readings that touched it.
        found: usize,
        /// Minimum number.
        expected: usize,
    },
    /// More patches than a posting can index.
    #[error("{found} training readings touched the object, expected at most {expected}")]
    TooMany {
        /// Number of patches.
        found: usize,
        /// Maximum number.
        expected: usize,
    },
}
