//! The surfaces of some objects of a catalogue, as their blocks have them.

use std::sync::Arc;

use palpate_recogniser::model::{AppearanceSpace, EvidenceCalibration, SurfaceMap, SurfaceModel};

/// The surfaces of some objects of a catalogue, and what all its objects share.
#[derive(Clone, Debug, PartialEq)]
pub struct Surfaces {
    /// The space of appearance.
    pub space: AppearanceSpace,
    /// The calibration of evidence.
    pub calibration: EvidenceCalibration,
    /// The maps of the objects, in their order.
    pub maps: Vec<Arc<SurfaceMap>>,
}

impl Surfaces {
    /// The model of these objects as a whole catalogue.
    #[must_use]
    pub fn model(self) -> SurfaceModel {
        SurfaceModel::new(self.space, self.calibration, self.maps)
    }
}
