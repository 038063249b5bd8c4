//! What the hybrid recogniser knows of the objects: their surfaces, and one appearance space.

use std::sync::Arc;

use crate::surface::{AppearanceSpace, SurfaceMap};

/// The surfaces of all objects of a catalogue.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceModel {
    /// What touches look like.
    pub space: AppearanceSpace,
    /// The maps, in the order of the catalogue's objects.
    pub maps: Vec<Arc<SurfaceMap>>,
}

impl SurfaceModel {
    /// Bytes of all maps in memory.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.maps.iter().map(|map| map.bytes()).sum()
    }
}
