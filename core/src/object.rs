//! Objects of a catalogue, and the touched points of their surfaces that training keeps.

use thiserror::Error;

/// An object of a catalogue, by its position.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ObjectIdx(pub u32);

/// A trained surface patch, in the object frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MapPatch {
    /// Position, metres.
    pub position: [f32; 3],
    /// Outward normal, norm 1.
    pub normal: [f32; 3],
    /// How well the contact fixed the normal, 0 to 1.
    pub normal_confidence: f32,
}

/// The fewest patches that make a map.
pub const MIN_PATCHES: usize = 10;

/// Why patches do not make a map.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum MapError {
    /// Too few readings touched the object.
    #[error("{found} training readings touched the object, expected at least {expected}")]
    TooFew {
        /// How many did.
        found: usize,
        /// How many are needed.
        expected: usize,
    },
    /// More patches than a posting can name.
    #[error("{found} training readings touched the object, expected at most {expected}")]
    TooMany {
        /// How many did.
        found: usize,
        /// How many are possible.
        expected: usize,
    },
}
