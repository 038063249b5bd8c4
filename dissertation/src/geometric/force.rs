//! Training with force: mosaics of planar objects, and the gains of their sensors.
//!
//! The gains are learnt from all objects together; mosaics have half the cells of the
//! occupancy maps beside them. Readings are in the object frame.

use std::sync::Arc;

use crate::geometric::model::{GeometricMap, GeometricModel, SensorGains};
use crate::geometric::train::GeometricTrainError;
use crate::mosaic::learn::{MosaicOptions, MosaicSet, build_mosaic, learn_gains};
use crate::occupancy::GridShape;
use palpate_core::reading::Reading;
use palpate_core::sensor::SensorDescription;

/// Adds mosaics and gains to a model of planar maps; `sets` are the objects' readings in
/// their own frames, with the sensor of the readings.
pub(super) fn add_force(
    model: &mut GeometricModel,
    sets: &[(Vec<Reading>, &SensorDescription)],
) -> Result<(), GeometricTrainError> {
    let options = MosaicOptions::default();
    let mut mosaic_sets = Vec::with_capacity(sets.len());
    for (map, (readings, sensor)) in model.maps.iter().zip(sets) {
        let shape = map.occupancy.shape();
        let [x, y, _] = shape.n();
        let shape = GridShape::new(shape.min(), 0.5 * shape.cell(), [2 * x, 2 * y, 1])?;
        mosaic_sets.push(MosaicSet { readings, sensor, shape });
    }
    let gains = learn_gains(&mosaic_sets, &options)?;
    let mut maps = Vec::with_capacity(sets.len());
    for (map, set) in model.maps.iter().zip(&mosaic_sets) {
        let mosaic = Some(build_mosaic(set, &gains, &options)?);
        maps.push(Arc::new(GeometricMap { occupancy: map.occupancy.clone(), mosaic }));
    }
    model.maps = maps;
    let known = |gains: crate::mosaic::learn::TaxelGains| SensorGains {
        sensor: gains.sensor,
        gains: gains.gains,
    };
    model.gains = gains.into_iter().map(known).collect();
    Ok(())
}
