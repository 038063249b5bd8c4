//! The model: the learnt surfaces of a catalogue's objects, and the calibration of evidence.
//!
//! A [`SurfaceMap`] holds thinned touches ([`SurfacePatch`]), a second form of each with the
//! curved surface about it ([`facet::Facet`]), voxels that find the patches near a point, a grid
//! of material (`solid`), and a table of patch pairs by their geometry (`pair_table`); some
//! pairs of all objects are in one table (`joint_pairs`). Appearance is a point of a
//! catalogue-wide [`AppearanceSpace`]. A divided model has outlines instead of maps (`parts`). Frames: the object's. Lengths in metres, single
//! precision: 80 mm has a resolution of 10 nm.

pub mod agreement;
pub mod appearance;
pub mod bend;
pub mod calibration;
pub mod facet;
pub mod features;
pub mod joint_pairs;
pub mod map;
pub mod near;
mod pair_cells;
pub mod pair_geometry;
pub mod pair_table;
mod parts;
pub mod patch;
mod self_match;
pub mod solid;
pub mod thinning;
pub mod voxels;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use palpate_core::symmetry::Symmetry;

pub use appearance::AppearanceSpace;
pub use calibration::{CalibrationBasis, EvidenceCalibration, EvidenceStage};
pub use map::SurfaceMap;
pub use parts::{OBJECTS_PER_BLOCK, Outline, Parts, Unanswered};
pub use patch::SurfacePatch;

use joint_pairs::JointPairs;
use self_match::SelfMatches;

/// Number of objects from which a catalogue is large and has a joint pair table.
const JOINT_OBJECTS_MIN: usize = 32;

/// The surfaces of all objects of a catalogue.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceModel {
    /// The space of appearance.
    pub space: AppearanceSpace,
    /// Calibration that maps evidence to probability. [`SurfaceModel::with_calibration`] replaces
    /// it, since self-match scores depend on its width.
    pub calibration: EvidenceCalibration,
    surfaces: Surfaces,
}

/// The maps of a model, or the parts that have them.
#[derive(Clone, Debug)]
enum Surfaces {
    /// The model has its maps.
    Whole {
        maps: Vec<Arc<SurfaceMap>>,
        joint_pairs: Option<Arc<JointPairs>>,
        self_matches: Arc<SelfMatches>,
    },
    /// The parts of the catalogue have them.
    Divided { outlines: Arc<[Outline]>, parts: Arc<dyn Parts> },
}

impl PartialEq for Surfaces {
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Whole { maps, .. }, Self::Whole { maps: others, .. }) => maps == others,
            (
                Self::Divided { outlines, parts },
                Self::Divided { outlines: others, parts: elsewhere },
            ) => outlines == others && Arc::ptr_eq(parts, elsewhere),
            _ => false,
        }
    }
}

impl SurfaceModel {
    /// The model of objects by their maps, with a joint pair table if they are many.
    #[must_use]
    pub fn new(
        space: AppearanceSpace,
        calibration: EvidenceCalibration,
        maps: Vec<Arc<SurfaceMap>>,
    ) -> Self {
        let n_objects = maps.len();
        Self::of_block(space, calibration, maps, n_objects)
    }

    /// The model of one block of a catalogue of `n_objects` by the maps of the block: the part that
    /// answers a divided model.
    #[must_use]
    pub fn of_block(
        space: AppearanceSpace,
        calibration: EvidenceCalibration,
        maps: Vec<Arc<SurfaceMap>>,
        n_objects: usize,
    ) -> Self {
        let is_large = n_objects >= JOINT_OBJECTS_MIN;
        let joint_pairs = is_large.then(|| Arc::new(JointPairs::build(&maps)));
        let self_matches = Arc::new(SelfMatches::new(maps.len()));
        Self { space, calibration, surfaces: Surfaces::Whole { maps, joint_pairs, self_matches } }
    }

    /// The model of objects whose maps others have. `outlines` has all objects in their order, at
    /// the width of the calibration.
    #[must_use]
    pub fn divided(
        space: AppearanceSpace,
        calibration: EvidenceCalibration,
        outlines: Vec<Outline>,
        parts: Arc<dyn Parts>,
    ) -> Self {
        let surfaces = Surfaces::Divided { outlines: outlines.into(), parts };
        Self { space, calibration, surfaces }
    }

    /// The same model with another calibration. A divided one keeps its width, on which its outlines
    /// depend.
    #[must_use]
    pub fn with_calibration(mut self, calibration: EvidenceCalibration) -> Self {
        let width = self.calibration.width;
        self.calibration = calibration;
        match &mut self.surfaces {
            Surfaces::Divided { .. } => self.calibration.width = width,
            Surfaces::Whole { maps, self_matches, .. } => {
                if width.total_cmp(&calibration.width).is_ne() {
                    *self_matches = Arc::new(SelfMatches::new(maps.len()));
                }
            }
        }
        self
    }

    /// The same space and calibration with the maps of other objects.
    #[must_use]
    pub fn with_maps(&self, maps: Vec<Arc<SurfaceMap>>) -> Self {
        Self::new(self.space.clone(), self.calibration, maps)
    }

    /// The number of objects.
    #[must_use]
    pub fn n_objects(&self) -> usize {
        match &self.surfaces {
            Surfaces::Whole { maps, .. } => maps.len(),
            Surfaces::Divided { outlines, .. } => outlines.len(),
        }
    }

    /// Whether the catalogue is large, so that it has a joint pair table.
    #[must_use]
    pub fn is_large(&self) -> bool {
        self.n_objects() >= JOINT_OBJECTS_MIN
    }

    /// Whether the maps are elsewhere.
    #[must_use]
    pub fn is_divided(&self) -> bool {
        self.parts().is_some()
    }

    /// The parts of a divided model.
    pub(crate) fn parts(&self) -> Option<&dyn Parts> {
        match &self.surfaces {
            Surfaces::Whole { .. } => None,
            Surfaces::Divided { parts, .. } => Some(&**parts),
        }
    }

    /// The maps, in the order of the catalogue's objects; none in a divided model.
    #[must_use]
    pub fn maps(&self) -> &[Arc<SurfaceMap>] {
        match &self.surfaces {
            Surfaces::Whole { maps, .. } => maps,
            Surfaces::Divided { .. } => &[],
        }
    }

    /// The map of an object, from the part that has it if the model is divided.
    ///
    /// # Errors
    /// [`Unanswered`] when that part does not answer.
    pub fn map(&self, object: usize) -> Result<Arc<SurfaceMap>, Unanswered> {
        match &self.surfaces {
            Surfaces::Whole { maps, .. } => Ok(Arc::clone(&maps[object])),
            Surfaces::Divided { parts, .. } => parts.maps(&[object]).pop().ok_or(Unanswered)?,
        }
    }

    /// The maps of some objects, without those whose part does not answer.
    #[must_use]
    pub fn maps_of(&self, objects: &BTreeSet<usize>) -> BTreeMap<usize, Arc<SurfaceMap>> {
        match &self.surfaces {
            Surfaces::Whole { maps, .. } => {
                objects.iter().map(|object| (*object, Arc::clone(&maps[*object]))).collect()
            }
            Surfaces::Divided { .. } if objects.is_empty() => BTreeMap::new(),
            Surfaces::Divided { parts, .. } => {
                let objects: Vec<usize> = objects.iter().copied().collect();
                let found = objects.iter().zip(parts.maps(&objects));
                found.filter_map(|(object, map)| Some((*object, map.ok()?))).collect()
            }
        }
    }

    /// The symmetry of an object.
    #[must_use]
    pub fn symmetry(&self, object: usize) -> &Symmetry {
        match &self.surfaces {
            Surfaces::Whole { maps, .. } => maps[object].symmetry(),
            Surfaces::Divided { outlines, .. } => &outlines[object].symmetry,
        }
    }

    /// [`SurfaceMap::radius`] of an object, metres.
    #[must_use]
    pub fn radius(&self, object: usize) -> f32 {
        match &self.surfaces {
            Surfaces::Whole { maps, .. } => maps[object].radius(),
            Surfaces::Divided { outlines, .. } => outlines[object].radius,
        }
    }

    /// [`SurfaceMap::reach`] of an object, metres.
    #[must_use]
    pub fn reach(&self, object: usize) -> f32 {
        match &self.surfaces {
            Surfaces::Whole { maps, .. } => maps[object].reach(),
            Surfaces::Divided { outlines, .. } => outlines[object].reach,
        }
    }

    /// The joint pair table; `None` when there are few objects, and in a divided model.
    #[must_use]
    pub fn joint_pairs(&self) -> Option<&JointPairs> {
        match &self.surfaces {
            Surfaces::Whole { joint_pairs, .. } => joint_pairs.as_deref(),
            Surfaces::Divided { .. } => None,
        }
    }

    /// The self-match score (equation R12) of an object by touches that say everything (0), no
    /// appearance (1), or nothing but their position (2); found by `find` from its map on first
    /// use. It must follow from the map, the space and the width.
    pub(crate) fn self_match(
        &self,
        object: usize,
        kind: usize,
        find: impl FnOnce(&SurfaceMap) -> f32,
    ) -> f32 {
        match &self.surfaces {
            Surfaces::Whole { maps, self_matches, .. } => {
                self_matches.score(object, kind, || find(&maps[object]))
            }
            Surfaces::Divided { outlines, .. } => outlines[object].self_matches[kind],
        }
    }

    /// Bytes in memory: of the maps and the joint pair table, or of the outlines.
    #[must_use]
    pub fn bytes(&self) -> usize {
        match &self.surfaces {
            Surfaces::Whole { maps, .. } => {
                let joint = self.joint_pairs().map_or(0, JointPairs::bytes);
                joint + maps.iter().map(|map| map.bytes()).sum::<usize>()
            }
            Surfaces::Divided { outlines, .. } => outlines.iter().map(Outline::bytes).sum(),
        }
    }
}
