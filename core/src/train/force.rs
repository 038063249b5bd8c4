//! Training of force: the same planar readings as the maps of contact, their pressures kept.
//!
//! Beyond the dissertation, which binarises them; `docs/equations.md`. Gains are learnt from
//! the presses of all objects together, each mosaic from its own object's. Frames are those
//! of `geometry`.

use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;

use super::geometry::in_object_frame;
use super::{TrainError, TrainingSet};
use crate::model::geometry::{GeometricMap, GeometricModel, SensorGains};
use crate::mosaic::learn::{MosaicOptions, MosaicSet, build_mosaic, learn_gains};
use crate::occupancy::{GridError, GridShape};
use crate::reading::Reading;
use crate::units::MM;

/// How force is trained.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceConfig {
    /// The side of a mosaic's cell, metres.
    pub cell: f64,
    /// How mosaics are learnt.
    pub mosaic: MosaicOptions,
}

impl Default for ForceConfig {
    /// Cells of 0.5 mm: a quarter of the taxels' pitch.
    fn default() -> Self {
        Self { cell: 0.5 * MM, mosaic: MosaicOptions::default() }
    }
}

/// Adds gains and force mosaics to planar maps; `sets` and `origins_in_training` (metres) are
/// those that `model` was mapped from.
///
/// # Errors
/// [`TrainError`] when the maps are not planar, or a mosaic would have too many cells.
pub fn learn_force(
    model: GeometricModel,
    sets: &[TrainingSet<'_>],
    origins_in_training: &[DVec3],
    config: &ForceConfig,
) -> Result<GeometricModel, TrainError> {
    let readings: Vec<Vec<Reading>> = sets
        .iter()
        .zip(origins_in_training)
        .map(|(set, origin)| in_object_frame(set, *origin))
        .collect();
    let sets: Vec<MosaicSet<'_>> = readings
        .iter()
        .zip(sets)
        .zip(&model.maps)
        .map(|((readings, set), map)| {
            let shape = mosaic_shape(map.occupancy.shape(), config.cell)?;
            Ok(MosaicSet { readings, sensor: set.sensor, shape })
        })
        .collect::<Result<_, GridError>>()?;
    let gains = learn_gains(&sets, &config.mosaic)?;
    let with_force = |(set, map): (&MosaicSet<'_>, &Arc<GeometricMap>)| {
        let mosaic = Some(build_mosaic(set, &gains, &config.mosaic)?);
        Ok(Arc::new(GeometricMap { occupancy: map.occupancy.clone(), mosaic }))
    };
    let maps =
        sets.par_iter().zip(&model.maps).map(with_force).collect::<Result<_, GridError>>()?;
    let gains =
        gains.into_iter().map(|known| SensorGains { sensor: known.sensor, gains: known.gains });
    Ok(GeometricModel { gains: gains.collect(), maps, ..model })
}

/// Cells of another side over the same area.
fn mosaic_shape(occupancy: &GridShape, cell: f64) -> Result<GridShape, GridError> {
    // Saturating casts: what is too large is refused.
    let [x, y, z] = occupancy.n().map(|n| (n as f64 * occupancy.cell() / cell).ceil() as usize);
    let layers = if occupancy.is_planar() { 1 } else { z };
    GridShape::new(occupancy.min(), cell, [x, y, layers])
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use glam::DQuat;

    use super::*;
    use crate::pose::Pose;
    use crate::reading::SensorId;
    use crate::sensor::SensorDescription;
    use crate::train::geometry::{GeometryConfig, map_geometry};
    use crate::units::KPA;

    /// Presses of a wall x < 0 that reads 10 kPa, by a sensor whose first taxel reads half.
    fn presses(sensor: &SensorDescription) -> Vec<Reading> {
        let places = (0..9).flat_map(|x| (0..9).map(move |y| (x - 4, y - 4)));
        let press = |(place, (x, y)): (usize, (i32, i32))| {
            let turn = DQuat::from_rotation_z(PI / 2.0 * place as f64);
            let place = 2.0 * MM * DVec3::new(f64::from(x), f64::from(y), 0.0);
            let pose = Pose::from_parts(turn * DQuat::from_rotation_x(PI), place);
            let image: Vec<Option<f64>> = (0..36)
                .map(|taxel| {
                    let (x, y) = sensor.grid().center(taxel / 6, taxel % 6);
                    let touched = (pose * DVec3::new(x, y, 0.0)).x < 0.0;
                    let gain = if taxel == 0 { 0.5 } else { 1.0 };
                    Some(if touched { gain * 10.0 * KPA } else { 0.0 })
                })
                .collect();
            Reading::new(SensorId(5), sensor, &image, pose).unwrap()
        };
        places.enumerate().map(press).collect()
    }

    #[test]
    fn pressures_and_gains_are_learnt_over_the_maps_area() {
        let sensor = SensorDescription::digitacts_6x6();
        let readings = presses(&sensor);
        let sets = [TrainingSet { readings: &readings, sensor: &sensor }];
        let origins = [DVec3::new(1.0 * MM, 0.0, 0.0)];
        let model = map_geometry(&sets, &origins, &GeometryConfig::planar()).unwrap();
        let model = learn_force(model, &sets, &origins, &ForceConfig::default()).unwrap();
        let [gains] = &model.gains[..] else { panic!("{:?}", model.gains) };
        assert_eq!(gains.sensor, SensorId(5));
        let others = gains.gains[1..].iter().sum::<f64>() / 35.0;
        assert!((gains.gains[0] / others - 0.5).abs() < 0.1, "{:?}", gains.gains);
        let mosaic = model.maps[0].mosaic.as_ref().unwrap();
        let shape = mosaic.shape();
        assert_eq!(shape.min(), model.maps[0].occupancy.shape().min());
        // The wall ends at x = −1 mm in the object frame.
        let at = |x: f64| {
            let near = |cell: &usize| shape.center(*cell).distance(DVec3::new(x, 0.0, 0.0)) < MM;
            let cell = (0..shape.n_cells()).find(near).unwrap();
            f64::from(mosaic.pressure()[cell])
        };
        let (wall, free) = (at(-5.0 * MM), at(3.0 * MM));
        assert!((wall / (10.0 * KPA) - 1.0).abs() < 0.1 && free < 1.0 * KPA, "{wall} {free}");
    }

    #[test]
    fn solid_maps_have_no_force() {
        let sensor = SensorDescription::digitacts_6x6();
        let readings = presses(&sensor);
        let sets = [TrainingSet { readings: &readings, sensor: &sensor }];
        let model = map_geometry(&sets, &[DVec3::ZERO], &GeometryConfig::solid()).unwrap();
        let error = learn_force(model, &sets, &[DVec3::ZERO], &ForceConfig::default());
        assert!(matches!(error, Err(TrainError::Grid(GridError::Count { .. }))));
    }
}
