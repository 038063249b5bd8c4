//! What the surface recogniser knows of the objects: their surfaces, one appearance space, and
//! how far its evidence can be believed.

use std::sync::Arc;

use crate::surface::joint_pairs::JointPairs;
use crate::surface::{AppearanceSpace, SurfaceMap};

/// The surfaces of all objects of a catalogue.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceModel {
    /// What touches look like.
    pub space: AppearanceSpace,
    /// How evidence becomes probability.
    pub calibration: EvidenceCalibration,
    maps: Vec<Arc<SurfaceMap>>,
    joint_pairs: Option<Arc<JointPairs>>,
}

/// With fewer objects each one's own pairs are asked.
const JOINT_OBJECTS_MIN: usize = 32;

impl SurfaceModel {
    /// The model of objects by their maps; of many objects some pairs are tabled together.
    #[must_use]
    pub fn new(
        space: AppearanceSpace,
        calibration: EvidenceCalibration,
        maps: Vec<Arc<SurfaceMap>>,
    ) -> Self {
        let is_large = maps.len() >= JOINT_OBJECTS_MIN;
        let joint_pairs = is_large.then(|| Arc::new(JointPairs::build(&maps)));
        Self { space, calibration, maps, joint_pairs }
    }

    /// The same model with evidence believed otherwise.
    #[must_use]
    pub fn with_calibration(self, calibration: EvidenceCalibration) -> Self {
        Self { calibration, ..self }
    }

    /// The same space and calibration with the maps of other objects.
    #[must_use]
    pub fn with_maps(&self, maps: Vec<Arc<SurfaceMap>>) -> Self {
        Self::new(self.space.clone(), self.calibration, maps)
    }

    /// The maps, in the order of the catalogue's objects.
    #[must_use]
    pub fn maps(&self) -> &[Arc<SurfaceMap>] {
        &self.maps
    }

    /// Some pairs of all objects in one table; `None` when there are few objects.
    #[must_use]
    pub fn joint_pairs(&self) -> Option<&JointPairs> {
        self.joint_pairs.as_deref()
    }

    /// Bytes of the maps and of what is tabled together, in memory.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let joint = self.joint_pairs().map_or(0, JointPairs::bytes);
        joint + self.maps.iter().map(|map| map.bytes()).sum::<usize>()
    }
}

/// How ln evidence becomes probability after one, two, and three or more touches: evidence of
/// an early touch is of another kind than that of hypotheses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EvidenceCalibration {
    /// After one, two, and three or more touches.
    pub stages: [EvidenceStage; 3],
    /// What it was learnt on.
    pub basis: CalibrationBasis,
}

/// What a calibration was learnt on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CalibrationBasis {
    /// Readings that had no part in the maps, of so many objects of a catalogue.
    HeldBack {
        /// How many objects they are of; 0 when a version of old does not say.
        objects: usize,
    },
    /// Nothing: with one object alone there are no touches of an object that is not known.
    OneObject,
    /// Nothing: of no object there are enough readings to hold some back.
    FewReadings,
}

/// How ln evidence becomes probability. Each object's evidence weighs by its prior and that of
/// "none of these" by its own, so that it does not depend on how many objects there are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EvidenceStage {
    /// Evidence is divided by this: above 1 it is believed less than it says.
    pub temperature: f64,
    /// ln evidence of "none of these".
    pub unknown: f64,
    /// What every touch adds to that, counted as the touches are.
    pub unknown_per_touch: f64,
}

impl EvidenceStage {
    /// ln evidence of "none of these" after so many touches, by what they count.
    #[must_use]
    pub fn log_unknown(&self, n_touches: f64) -> f64 {
        self.unknown + self.unknown_per_touch * n_touches
    }
}

impl EvidenceCalibration {
    /// The stage after so many touches.
    #[must_use]
    pub fn stage(&self, n_touches: usize) -> &EvidenceStage {
        &self.stages[n_touches.clamp(1, 3) - 1]
    }
}

impl Default for EvidenceCalibration {
    /// For catalogues of which nothing can be held back. Fitted to simulated touches of the ten
    /// built-in objects (seed 101), and of no other sensor; 7.24 is 13, as it was fitted when each
    /// of ten objects weighed 1 instead of a tenth, less 2.5 ln 10.
    fn default() -> Self {
        let stage = |temperature, unknown, unknown_per_touch| EvidenceStage {
            temperature,
            unknown,
            unknown_per_touch,
        };
        let stages = [stage(1.0, 0.0, 0.0), stage(1.2, 0.0, 0.0), stage(2.5, 7.24, 8.5)];
        Self { stages, basis: CalibrationBasis::FewReadings }
    }
}
