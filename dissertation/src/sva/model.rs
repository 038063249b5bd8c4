//! The model of spatially varying appearance: immutable maps of objects over one vocabulary.
//!
//! An object frame has its origin at the centroid of the object's training touches, or of its
//! mesh when trained from one, and the axes of training.

use std::sync::Arc;

use glam::DVec3;

use crate::patch::Patch;
use crate::patch_pair::index::{IndexedPatch, MAX_PATCHES};
use crate::patch_pair::{DistanceBins, PairIndex};
use palpate_core::object::{MIN_PATCHES, MapError, MapPatch};
use palpate_core::vocabulary::{AssociationRule, Vocabulary};

/// The map of one object: its patches and the index of their pairs (section 5.3).
#[derive(Clone, Debug, PartialEq)]
pub struct ObjectMap {
    origin_in_training: DVec3,
    patches: Vec<MapPatch>,
    index: PairIndex,
}

impl ObjectMap {
    /// Maps patches given in the training frame; `origin_in_training` (metres) becomes the
    /// origin of the object frame.
    ///
    /// # Errors
    /// [`MapError`] for fewer than [`MIN_PATCHES`] or more than 65,536 patches.
    pub fn build(
        patches: &[Patch],
        origin_in_training: DVec3,
        n_classes: usize,
        distances: DistanceBins,
    ) -> Result<Self, MapError> {
        let found = patches.len();
        if found < MIN_PATCHES {
            return Err(MapError::TooFew { found, expected: MIN_PATCHES });
        }
        if found > MAX_PATCHES {
            return Err(MapError::TooMany { found, expected: MAX_PATCHES });
        }
        let single = |v: DVec3| v.to_array().map(|value| value as f32);
        let stored: Vec<MapPatch> = patches
            .iter()
            .map(|patch| MapPatch {
                position: single(patch.position - origin_in_training),
                normal: single(patch.normal),
                normal_confidence: patch.normal_confidence as f32,
            })
            .collect();
        let indexed: Vec<IndexedPatch<'_>> = stored
            .iter()
            .zip(patches)
            .map(|(map, patch)| IndexedPatch { position: map.position, classes: &patch.classes })
            .collect();
        let index = PairIndex::build(&indexed, n_classes, distances);
        Ok(Self { origin_in_training, patches: stored, index })
    }

    /// Restores a map from its stored parts; `None` when the index names a patch that does
    /// not exist.
    #[must_use]
    pub fn from_parts(
        origin_in_training: DVec3,
        patches: Vec<MapPatch>,
        index: PairIndex,
    ) -> Option<Self> {
        let named = index.postings().iter().map(|p| usize::from(p.first.max(p.second))).max();
        named.is_none_or(|patch| patch < patches.len()).then_some(Self {
            origin_in_training,
            patches,
            index,
        })
    }

    /// The origin of the object frame in the frame of the mesh or of the training readings,
    /// metres.
    #[must_use]
    pub fn origin_in_training(&self) -> DVec3 {
        self.origin_in_training
    }

    /// The patches, in the order of training.
    #[must_use]
    pub fn patches(&self) -> &[MapPatch] {
        &self.patches
    }

    /// The index of the patches' pairs.
    #[must_use]
    pub fn index(&self) -> &PairIndex {
        &self.index
    }
}

/// The vocabulary and the maps of all objects.
#[derive(Clone, Debug, PartialEq)]
pub struct SvaModel {
    /// The shared appearance classes.
    pub vocabulary: Vocabulary,
    /// Association of features with classes, in training and recognition.
    pub association: AssociationRule,
    /// The objects; [`palpate_core::object::ObjectIdx`] counts them.
    pub objects: Vec<Arc<ObjectMap>>,
}
