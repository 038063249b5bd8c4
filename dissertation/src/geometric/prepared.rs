//! Maps of a catalogue prepared for look-up, shared by all beliefs.
//!
//! The look-up tables depend on the width of a filter's bins: tiles, planes and blurred maps
//! are created on first use, shared while a belief holds them, and counted. Reaches are
//! rounded to steps, so that their number is small for any pose priors of clients.

use std::sync::Arc;

use super::GeometricError;
use super::blur::blurred;
use super::tables::{Counted, TableBudget, Tables};
use crate::filter::histogram::{HistogramModel, PlanarBins};
use crate::filter::planes::BinShare;
use crate::geometric::model::GeometricModel;
use crate::mosaic::ForceMosaic;
use crate::mosaic::screen::ScreenTile;
use crate::mosaic::tile::Tile;
use crate::occupancy::OccupancyGrid;
use palpate_core::units::MM;

/// Step of reaches, metres.
const STEP: f64 = 0.1 * MM;

/// Largest reach in steps; a larger one blurs a map away.
const STEPS_MAX: usize = 100;

/// Cells of the screening, metres; well below the point spread.
const SCREEN_CELL: f64 = 0.5 * MM;

/// The spreads for which blurred solid maps are kept, metres.
pub(super) const BLURS: [f64; 4] = [0.0, 1.5 * MM, 3.0 * MM, 6.0 * MM];

/// An object's solid map by [`BLURS`].
pub(super) type Blurs = Counted<Vec<OccupancyGrid>>;

/// The planes of all objects.
pub(super) type Planes = Counted<Arc<HistogramModel>>;

/// The geometry of a catalogue with the tables of its beliefs.
#[derive(Debug)]
pub struct PreparedGeometry {
    model: Arc<GeometricModel>,
    budget: Arc<TableBudget>,
    /// By object and reach, in steps.
    tiles: Tables<(usize, usize), Tile>,
    screens: Tables<(usize, usize), ScreenTile>,
    /// By object.
    blurs: Tables<usize, Vec<OccupancyGrid>>,
    /// By the bits of a bin's sides, and the number of angles.
    planes: Tables<[u64; 3], Arc<HistogramModel>>,
}

impl PreparedGeometry {
    /// Without tables, and without a limit on them.
    #[must_use]
    pub fn new(model: Arc<GeometricModel>) -> Self {
        Self::within(model, TableBudget::new(usize::MAX))
    }

    /// Like `new`, within a budget.
    #[must_use]
    pub fn within(model: Arc<GeometricModel>, budget: Arc<TableBudget>) -> Self {
        let (tiles, screens) = (Tables::new(), Tables::new());
        let (blurs, planes) = (Tables::new(), Tables::new());
        Self { model, budget, tiles, screens, blurs, planes }
    }

    /// The maps as trained.
    #[must_use]
    pub fn model(&self) -> &Arc<GeometricModel> {
        &self.model
    }

    /// The tile of an object's mosaic for position errors up to `reach` (m).
    pub(super) fn tile(
        &self,
        object: usize,
        reach: f64,
    ) -> Result<Arc<Counted<Tile>>, GeometricError> {
        let (mosaic, step) = (self.mosaic(object)?, steps(reach));
        let tile = || Tile::new(mosaic, step as f64 * STEP);
        self.tiles.get((object, step), &self.budget, Tile::bytes_of(mosaic), tile)
    }

    /// The screening tile for position errors up to `reach` (m).
    pub(super) fn screen(
        &self,
        object: usize,
        reach: f64,
    ) -> Result<Arc<Counted<ScreenTile>>, GeometricError> {
        let (mosaic, step) = (self.mosaic(object)?, steps(reach));
        let tile = || ScreenTile::new(mosaic, SCREEN_CELL, step as f64 * STEP);
        let bytes = ScreenTile::bytes_of(mosaic, SCREEN_CELL);
        self.screens.get((object, step), &self.budget, bytes, tile)
    }

    /// An object's solid map by [`BLURS`].
    pub(super) fn blurs(&self, object: usize) -> Result<Arc<Blurs>, GeometricError> {
        let map = &self.model.maps[object].occupancy;
        let blurs = || BLURS.iter().map(|sigma| blurred(map, *sigma)).collect();
        self.blurs.get(object, &self.budget, BLURS.len() * map_bytes(map), blurs)
    }

    /// The planes of all objects for these bins.
    pub(super) fn planes(&self, bins: &PlanarBins) -> Result<Arc<Planes>, GeometricError> {
        let maps = || self.model.maps.iter().map(|map| map.occupancy.clone()).collect();
        let table = self.model.table.clone();
        let planes = || Arc::new(HistogramModel::new(maps(), table, bins, BinShare::Center));
        self.planes.get(key(bins), &self.budget, self.planes_bytes(bins), planes)
    }

    /// Bytes of the planes for these bins, whether they exist or not.
    pub(super) fn planes_bytes(&self, bins: &PlanarBins) -> usize {
        let maps = self.model.maps.iter().map(|map| &map.occupancy);
        maps.map(|map| HistogramModel::bytes_of(map, bins).saturating_add(map_bytes(map)))
            .fold(0, usize::saturating_add)
    }

    /// Whether a belief holds the planes for these bins.
    pub(super) fn has_planes(&self, bins: &PlanarBins) -> bool {
        self.planes.has(&key(bins))
    }

    /// Bytes of two tiles, an exact one and a screening one of every object.
    pub(super) fn tiles_bytes(&self) -> usize {
        let mosaics = self.model.maps.iter().filter_map(|map| map.mosaic.as_ref());
        let bytes = |mosaic| 3 * Tile::bytes_of(mosaic) + ScreenTile::bytes_of(mosaic, SCREEN_CELL);
        mosaics.map(bytes).sum()
    }

    /// Whether a belief holds the exact tile of the first object.
    pub(super) fn has_tiles(&self) -> bool {
        self.tiles.has(&(0, 0))
    }

    /// Whether a belief holds the blurred maps of the first object.
    pub(super) fn has_blurs(&self) -> bool {
        self.blurs.has(&0)
    }

    /// Bytes of the blurred maps of all objects.
    pub(super) fn blurs_bytes(&self) -> usize {
        self.model.maps.iter().map(|map| BLURS.len() * map_bytes(&map.occupancy)).sum()
    }

    /// The mosaic of an object of planar maps.
    pub(super) fn mosaic(&self, object: usize) -> Result<&ForceMosaic, GeometricError> {
        let map = &self.model.maps[object];
        if !map.occupancy.shape().is_planar() {
            return Err(GeometricError::NotPlanar);
        }
        map.mosaic.as_ref().ok_or(GeometricError::NoMosaic { object })
    }
}

fn map_bytes(map: &OccupancyGrid) -> usize {
    size_of_val(map.log_odds())
}

/// The parameters of planes.
fn key(bins: &PlanarBins) -> [u64; 3] {
    let sides = bins.sides();
    [sides.x.to_bits(), sides.y.to_bits(), bins.n[2] as u64]
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
