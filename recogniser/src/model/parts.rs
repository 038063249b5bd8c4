//! Parts of a catalogue: the maps of a divided model are elsewhere, in blocks of objects.
//!
//! A model holds the outline of every object, which decides without a map, and [`Parts`], which
//! work on the maps and bring a few of them. Blocks are the objects of one joint pair table, so
//! that a lookup does not depend on the division. Pure: who has which block, and how bytes get
//! there, is the caller's business.

use std::fmt::Debug;
use std::sync::Arc;

use palpate_core::symmetry::{Symmetry, SymmetryAxis};
use thiserror::Error;

use super::joint_pairs::OBJECTS_PER_TABLE;
use super::map::SurfaceMap;
use super::self_match::KINDS;
use crate::coding::{Coded, NotWork};

/// Objects of a block, in the order of the catalogue; the last block may have fewer.
pub const OBJECTS_PER_BLOCK: usize = OBJECTS_PER_TABLE;

/// The holder of a map did not answer, or answered nonsense.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[error("the part of the catalogue that holds the object's map did not answer")]
pub struct Unanswered;

/// Parts of a catalogue that have its maps.
pub trait Parts: Send + Sync + Debug {
    /// Asks each block for work (`belief::parts::answer`) and waits for all replies; they have the
    /// order of the requests.
    fn ask(&self, requests: Vec<(usize, Vec<u8>)>) -> Vec<Result<Vec<u8>, Unanswered>>;

    /// The maps of a few objects, in their order.
    fn maps(&self, objects: &[usize]) -> Vec<Result<Arc<SurfaceMap>, Unanswered>>;
}

/// What a divided model holds of an object.
#[derive(Clone, Debug, PartialEq)]
pub struct Outline {
    /// [`SurfaceMap::radius`], metres.
    pub radius: f32,
    /// [`SurfaceMap::reach`], metres.
    pub reach: f32,
    /// The symmetry of the object.
    pub symmetry: Symmetry,
    /// Self-match scores (equation R12) at the model's width, by touches that say everything, that
    /// lack appearance, and that lack a normal too; ln per touch.
    pub self_matches: [f32; KINDS],
}

impl Outline {
    /// Bytes in memory.
    pub(super) fn bytes(&self) -> usize {
        size_of::<Self>() + self.symmetry.axes.capacity() * size_of::<SymmetryAxis>()
    }
}

impl Coded for Outline {
    fn put(&self, to: &mut Vec<u8>) {
        let Self { radius, reach, symmetry, self_matches } = self;
        [*radius, *reach].put(to);
        symmetry.put(to);
        self_matches.put(to);
    }

    fn take(from: &mut &[u8]) -> Result<Self, NotWork> {
        let (radius, reach) = Coded::take(from)?;
        Ok(Self { radius, reach, symmetry: Coded::take(from)?, self_matches: Coded::take(from)? })
    }
}
