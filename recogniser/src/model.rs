//! The model: the learnt surfaces of a catalogue's objects, and the calibration of evidence.
//!
//! A [`SurfaceMap`] holds thinned touches ([`SurfacePatch`]), a second form of each with the
//! curved surface about it ([`facet::Facet`]), voxels that find the patches near a point, a grid
//! of material (`solid`), and a table of patch pairs by their geometry (`pair_table`); some
//! pairs of all objects are in one table (`joint_pairs`). Appearance is a point of a
//! catalogue-wide [`AppearanceSpace`]. Frames: the object's. Lengths in metres, single precision:
//! 80 mm has a resolution of 10 nm.

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
pub mod patch;
mod self_match;
pub mod solid;
pub mod thinning;
pub mod voxels;

use std::sync::Arc;

use palpate_core::symmetry::Symmetry;

pub use appearance::AppearanceSpace;
pub use calibration::{CalibrationBasis, EvidenceCalibration, EvidenceStage};
pub use map::SurfaceMap;
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
    maps: Vec<Arc<SurfaceMap>>,
    joint_pairs: Option<Arc<JointPairs>>,
    self_matches: Arc<SelfMatches>,
}

impl SurfaceModel {
    /// The model of objects by their maps, with a joint pair table if they are many.
    #[must_use]
    pub fn new(
        space: AppearanceSpace,
        calibration: EvidenceCalibration,
        maps: Vec<Arc<SurfaceMap>>,
    ) -> Self {
        let is_large = maps.len() >= JOINT_OBJECTS_MIN;
        let joint_pairs = is_large.then(|| Arc::new(JointPairs::build(&maps)));
        let self_matches = Arc::new(SelfMatches::new(maps.len()));
        Self { space, calibration, maps, joint_pairs, self_matches }
    }

    /// The same model with another calibration.
    #[must_use]
    pub fn with_calibration(mut self, calibration: EvidenceCalibration) -> Self {
        if self.calibration.width.total_cmp(&calibration.width).is_ne() {
            self.self_matches = Arc::new(SelfMatches::new(self.maps.len()));
        }
        self.calibration = calibration;
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
        self.maps.len()
    }

    /// Whether the catalogue is large, so that it has a joint pair table.
    #[must_use]
    pub fn is_large(&self) -> bool {
        self.n_objects() >= JOINT_OBJECTS_MIN
    }

    /// The maps, in the order of the catalogue's objects.
    #[must_use]
    pub fn maps(&self) -> &[Arc<SurfaceMap>] {
        &self.maps
    }

    /// The symmetry of an object.
    #[must_use]
    pub fn symmetry(&self, object: usize) -> &Symmetry {
        self.maps[object].symmetry()
    }

    /// [`SurfaceMap::radius`] of an object, metres.
    #[must_use]
    pub fn radius(&self, object: usize) -> f32 {
        self.maps[object].radius()
    }

    /// [`SurfaceMap::reach`] of an object, metres.
    #[must_use]
    pub fn reach(&self, object: usize) -> f32 {
        self.maps[object].reach()
    }

    /// The joint pair table; `None` when there are few objects.
    #[must_use]
    pub fn joint_pairs(&self) -> Option<&JointPairs> {
        self.joint_pairs.as_deref()
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
        self.self_matches.score(object, kind, || find(&self.maps[object]))
    }

    /// Bytes in memory of the maps and the joint pair table.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let joint = self.joint_pairs().map_or(0, JointPairs::bytes);
        joint + self.maps.iter().map(|map| map.bytes()).sum::<usize>()
    }
}
