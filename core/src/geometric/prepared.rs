//! Maps made ready for look-up, once for all beliefs about a catalogue.
//!
//! What a filter looks up depends on the width of its bins: tiles and blurred maps are made
//! when a belief first asks for them and shared from then on. Widths are rounded to
//! steps, so that there are few of them whatever pose priors clients choose.

use std::sync::{Arc, OnceLock};

use super::GeometricError;
use super::blur::blurred;
use crate::model::geometry::GeometricModel;
use crate::mosaic::ForceMosaic;
use crate::mosaic::screen::ScreenTile;
use crate::mosaic::tile::Tile;
use crate::occupancy::OccupancyGrid;
use crate::units::MM;

/// The step of reaches, metres.
const STEP: f64 = 0.1 * MM;

/// Reaches beyond so many steps count as that: by then nothing of a map is left.
const STEPS_MAX: usize = 100;

/// Cells of the screening, metres: well below the point spread.
const SCREEN_CELL: f64 = 0.5 * MM;

/// The spreads for which blurred solid maps are kept, metres.
pub(super) const BLURS: [f64; 4] = [0.0, 1.5 * MM, 3.0 * MM, 6.0 * MM];

/// The geometry of a catalogue with what beliefs have made of it so far.
#[derive(Debug)]
pub struct PreparedGeometry {
    model: Arc<GeometricModel>,
    objects: Vec<PreparedMap>,
}

/// What has been made of one object's map.
#[derive(Debug)]
struct PreparedMap {
    /// By reach, in steps.
    tiles: [OnceLock<Arc<Tile>>; STEPS_MAX + 1],
    screens: [OnceLock<Arc<ScreenTile>>; STEPS_MAX + 1],
    blurs: OnceLock<Arc<[OccupancyGrid]>>,
}

impl PreparedGeometry {
    /// Nothing is made yet.
    #[must_use]
    pub fn new(model: Arc<GeometricModel>) -> Self {
        let empty = || PreparedMap {
            tiles: [const { OnceLock::new() }; STEPS_MAX + 1],
            screens: [const { OnceLock::new() }; STEPS_MAX + 1],
            blurs: OnceLock::new(),
        };
        let objects = model.maps.iter().map(|_| empty()).collect();
        Self { model, objects }
    }

    /// The maps as trained.
    #[must_use]
    pub fn model(&self) -> &Arc<GeometricModel> {
        &self.model
    }

    /// The tile of an object's mosaic for places that may be `reach` (m) off.
    pub(super) fn tile(&self, object: usize, reach: f64) -> Result<Arc<Tile>, GeometricError> {
        let (mosaic, step) = (self.mosaic(object)?, steps(reach));
        let tile = || Arc::new(Tile::new(mosaic, step as f64 * STEP));
        Ok(self.objects[object].tiles[step].get_or_init(tile).clone())
    }

    /// The tile for screening places that may be `reach` (m) off.
    pub(super) fn screen(
        &self,
        object: usize,
        reach: f64,
    ) -> Result<Arc<ScreenTile>, GeometricError> {
        let (mosaic, step) = (self.mosaic(object)?, steps(reach));
        let tile = || Arc::new(ScreenTile::new(mosaic, SCREEN_CELL, step as f64 * STEP));
        Ok(self.objects[object].screens[step].get_or_init(tile).clone())
    }

    /// An object's solid map by [`BLURS`].
    pub(super) fn blurs(&self, object: usize) -> Arc<[OccupancyGrid]> {
        let map = &self.model.maps[object].occupancy;
        let blurs = || BLURS.iter().map(|sigma| blurred(map, *sigma)).collect();
        self.objects[object].blurs.get_or_init(blurs).clone()
    }

    fn mosaic(&self, object: usize) -> Result<&ForceMosaic, GeometricError> {
        let map = &self.model.maps[object];
        if !map.occupancy.shape().is_planar() {
            return Err(GeometricError::NotPlanar);
        }
        map.mosaic.as_ref().ok_or(GeometricError::NoMosaic { object })
    }
}

fn steps(reach: f64) -> usize {
    ((reach / STEP).round().max(0.0) as usize).min(STEPS_MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reaches_are_rounded_to_steps() {
        assert_eq!(steps(0.0), 0);
        assert_eq!(steps(0.14 * MM), 1);
        assert_eq!(steps(0.16 * MM), 2);
        assert_eq!(steps(1.0), STEPS_MAX);
    }
}
