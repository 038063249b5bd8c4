//! Training of geometry: maps of chapter 3 from readings of known objects.
//!
//! Source: section 3.2 and `docs/equations.md`. An object's map depends on its own readings
//! alone; the table of class probabilities is learnt from all objects together. Frames:
//! readings are in the training frame, maps in the object frame, which has its origin at
//! `origin_in_training` and the axes of training.

use std::sync::Arc;

use glam::DVec3;
use thiserror::Error;

use crate::geometric::force::add_force;
use crate::geometric::model::{GeometricMap, GeometricModel};
use crate::mosaic::ForceMosaic;
use crate::mosaic::face::FaceDepth;
use crate::occupancy::mapping::{map_presses, shape_around};
use crate::occupancy::{
    ClassifiedPress, ContactClass, GridError, GridShape, InverseModel, OccupancyGrid, learn_table,
};
use palpate_core::object::MapError;
use palpate_core::pose::Pose;
use palpate_core::reading::Reading;
use palpate_core::sensor::SensorDescription;
use palpate_core::training::{TrainingError, TrainingSet};
use palpate_core::units::{DEG, MM};

/// Largest tilt of a planar press from the object's −z.
pub const PLANAR_TILT_MAX: f64 = 30.0 * DEG;

/// Error of readings from which geometry cannot be trained.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum GeometricTrainError {
    /// The readings cannot be used for training.
    #[error(transparent)]
    Readings(#[from] TrainingError),
    /// The cells of a map are not valid.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// The number of origins is not the number of objects.
    #[error("{found} origins of object frames, expected {expected}, one an object")]
    Origins {
        /// The number of objects.
        expected: usize,
        /// The number of origins.
        found: usize,
    },
    /// A reading for a planar map does not press along the object's −z.
    #[error(
        "reading {reading} of object {object} presses {tilt_degrees:.1} degrees off the object's \
         -z, expected at most 30 for a planar map"
    )]
    NotPlanar {
        /// The object's index.
        object: usize,
        /// Its first such reading.
        reading: usize,
        /// The angle between the sensor's z and the object's −z, degrees.
        tilt_degrees: f64,
    },
}

/// Planar or solid maps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dimensions {
    /// A plane, pressed along the object's −z: poses are x, y and an angle.
    Planar,
    /// Space: poses have six dimensions.
    Solid,
}

/// Configuration of training.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GeometricConfig {
    /// Planar or solid maps.
    pub dimensions: Dimensions,
    /// The side of a cell, metres.
    pub cell: f64,
    /// Inverse sensor model: the evidence of a press for the cells around it.
    pub inverse: InverseModel,
}

impl GeometricConfig {
    /// Planar maps of 1 mm cells.
    #[must_use]
    pub fn planar() -> Self {
        Self { dimensions: Dimensions::Planar, cell: 1.0 * MM, inverse: InverseModel::default() }
    }

    /// Solid maps of 2 mm cells.
    #[must_use]
    pub fn solid() -> Self {
        Self { dimensions: Dimensions::Solid, cell: 2.0 * MM, ..Self::planar() }
    }
}

impl Default for GeometricConfig {
    fn default() -> Self {
        Self::planar()
    }
}

/// Maps the objects of `sets`, whose frames' origins lie at `origins_in_training` (metres).
///
/// A planar map keeps x and y alone; its plane is that of the pressed face, in the object
/// frame: above the touching sensors by their indentation.
///
/// # Errors
/// [`GeometricTrainError`] when an object has no reading or no origin, when a planar reading does
/// not press along −z, or when a map would have too many cells.
pub fn map_geometry(
    sets: &[TrainingSet<'_>],
    origins_in_training: &[DVec3],
    config: &GeometricConfig,
) -> Result<GeometricModel, GeometricTrainError> {
    if sets.len() != origins_in_training.len() {
        let (expected, found) = (sets.len(), origins_in_training.len());
        return Err(GeometricTrainError::Origins { expected, found });
    }
    let mut presses = Vec::new();
    let mut maps = Vec::new();
    let mut pressed = Vec::new();
    for (object, (set, origin)) in sets.iter().zip(origins_in_training).enumerate() {
        let readings = in_object_frame(set, *origin);
        if config.dimensions == Dimensions::Planar {
            check_planar(&readings, object)?;
        }
        let (map, classified) = map_one(&readings, set, config)?;
        presses.push(classified);
        maps.push(map);
        pressed.push((readings, set.sensor));
    }
    let table = learn_table(&presses, &maps);
    let geometric = |occupancy| Arc::new(GeometricMap { occupancy, mosaic: None });
    let maps = maps.into_iter().map(geometric).collect();
    let mut model = GeometricModel { table, gains: Vec::new(), maps };
    if config.dimensions == Dimensions::Planar {
        add_force(&mut model, &pressed)?;
        for (map, (_, sensor)) in model.maps.iter_mut().zip(&pressed) {
            *map = Arc::new(at_the_face(map, sensor)?);
        }
    }
    Ok(model)
}

/// Moves a map from the plane of the sensors to that of the pressed face.
fn at_the_face(
    map: &GeometricMap,
    sensor: &SensorDescription,
) -> Result<GeometricMap, GeometricTrainError> {
    let Some(mosaic) = &map.mosaic else { return Ok(map.clone()) };
    let depth = FaceDepth::of_mosaic(mosaic, sensor).mean;
    let raised =
        |shape: &GridShape| GridShape::new(shape.min() + depth * DVec3::Z, shape.cell(), shape.n());
    let (shape, occupancy) = (raised(map.occupancy.shape())?, &map.occupancy);
    let log_odds = occupancy.log_odds().to_vec();
    let occupancy = OccupancyGrid::from_parts(shape, occupancy.prior(), log_odds)?;
    let (pressure, deviation) = (mosaic.pressure().to_vec(), mosaic.deviation().to_vec());
    let mosaic = ForceMosaic::from_parts(raised(mosaic.shape())?, pressure, deviation)?;
    Ok(GeometricMap { occupancy, mosaic: Some(mosaic) })
}

/// The readings of a set in the object frame.
fn in_object_frame(set: &TrainingSet<'_>, origin_in_training: DVec3) -> Vec<Reading> {
    let object_from_training = Pose { translation: -origin_in_training, ..Pose::IDENTITY };
    set.readings.iter().map(|reading| reading.moved_by(object_from_training)).collect()
}

fn map_one(
    readings: &[Reading],
    set: &TrainingSet<'_>,
    config: &GeometricConfig,
) -> Result<(OccupancyGrid, Vec<ClassifiedPress>), GeometricTrainError> {
    if readings.is_empty() {
        return Err(TrainingError::Map(MapError::TooFew { found: 0, expected: 1 }).into());
    }
    let presses: Vec<ClassifiedPress> =
        readings.iter().map(|reading| config.inverse.classified(reading, set.sensor)).collect();
    let plane = match config.dimensions {
        Dimensions::Planar => Some(pressed_height(readings, &presses)),
        Dimensions::Solid => None,
    };
    let margin = set.sensor.parameters().point_spread;
    let shape = shape_around(readings, set.sensor, config.cell, margin, plane)?;
    Ok((map_presses(&presses, set.sensor, shape, &config.inverse), presses))
}

/// The mean height of the touching sensors, or of all without any contact, metres.
fn pressed_height(readings: &[Reading], presses: &[ClassifiedPress]) -> f64 {
    let touches = |press: &ClassifiedPress| {
        press.taxels().iter().any(|(_, class)| *class == ContactClass::InContact)
    };
    let height = |reading: &Reading| reading.session_from_sensor().translation.z;
    let touching: Vec<f64> = readings
        .iter()
        .zip(presses)
        .filter(|(_, press)| touches(press))
        .map(|(reading, _)| height(reading))
        .collect();
    let heights =
        if touching.is_empty() { readings.iter().map(height).collect() } else { touching };
    heights.iter().sum::<f64>() / heights.len() as f64
}

fn check_planar(readings: &[Reading], object: usize) -> Result<(), GeometricTrainError> {
    let tilt = |reading: &Reading| {
        reading.session_from_sensor().turn(DVec3::Z).angle_between(DVec3::NEG_Z)
    };
    let tilted = readings.iter().map(tilt).enumerate().find(|(_, tilt)| *tilt > PLANAR_TILT_MAX);
    match tilted {
        Some((reading, tilt)) => {
            Err(GeometricTrainError::NotPlanar { object, reading, tilt_degrees: tilt / DEG })
        }
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;
    use palpate_core::reading::SensorId;
    use palpate_core::units::KPA;

    /// Presses straight down at height `z` on a strip |x| < 3 mm that is 20 mm long.
    fn presses(z: f64, tilt: f64) -> Vec<Reading> {
        let sensor = SensorDescription::digitacts_6x6();
        let down = DQuat::from_rotation_x(std::f64::consts::PI + tilt);
        let mut readings = Vec::new();
        for y in -2..=2 {
            for x in -2..=2 {
                let place = 5.0 * MM * DVec3::new(f64::from(x), f64::from(y), 0.0);
                let pose = Pose::from_parts(down, place.with_z(z));
                let image: Vec<Option<f64>> = (0..36)
                    .map(|taxel| {
                        let (x, y) = sensor.grid().center(taxel / 6, taxel % 6);
                        let point = pose * DVec3::new(x, y, 0.0);
                        let touched = point.x.abs() < 3.0 * MM && point.y.abs() < 10.0 * MM;
                        Some(if touched { 10.0 * KPA } else { 0.0 })
                    })
                    .collect();
                readings.push(Reading::new(SensorId(0), &sensor, &image, pose).unwrap());
            }
        }
        readings
    }

    fn mapped(
        readings: &[Reading],
        origin: DVec3,
        config: &GeometricConfig,
    ) -> Result<GeometricModel, GeometricTrainError> {
        let sensor = SensorDescription::digitacts_6x6();
        map_geometry(&[TrainingSet { readings, sensor: &sensor }], &[origin], config)
    }

    #[test]
    fn a_planar_map_lies_in_the_object_frame_at_the_face() {
        let origin = DVec3::new(4.0 * MM, 0.0, 1.0 * MM);
        let model = mapped(&presses(3.0 * MM, 0.0), origin, &GeometricConfig::planar()).unwrap();
        let (map, mosaic) = (&model.maps[0].occupancy, model.maps[0].mosaic.as_ref().unwrap());
        // The sensors are 2 mm above the origin. 10 kPa are half of the covering's 2.54 mm,
        // so the face is 1.27 to 2.54 mm higher: in the middle, except for the effect of
        // presses with steps as edges on the mosaic.
        let height = map.shape().min().z;
        assert!((3.6 * MM..4.3 * MM).contains(&height), "{height}");
        assert!((mosaic.shape().min().z - height).abs() < 1e-12);
        // The strip's middle lies at −4 mm now.
        let at = |x: f64| map.log_odds_at(DVec3::new(x, 0.0, 0.0));
        assert!(at(-4.0 * MM) > 2.0 && at(4.0 * MM) < -2.0, "{} {}", at(-4.0 * MM), at(4.0 * MM));
        // For certain cells the table is certain as well, up to its smoothing.
        let touching = model.table.probability(ContactClass::InContact, 8.0);
        let free = model.table.probability(ContactClass::NoContact, -8.0);
        assert!(touching > 0.8 && free > 0.8, "{touching} {free} {:?}", model.table);
    }

    #[test]
    fn tilted_readings_are_refused_in_planar_maps_alone() {
        let readings = presses(0.0, 40.0 * DEG);
        let error = mapped(&readings, DVec3::ZERO, &GeometricConfig::planar()).unwrap_err();
        let GeometricTrainError::NotPlanar { object: 0, reading: 0, tilt_degrees } = error else {
            panic!("{error}");
        };
        assert!((tilt_degrees - 40.0).abs() < 1e-9);
        let solid = mapped(&readings, DVec3::ZERO, &GeometricConfig::solid()).unwrap();
        assert!(!solid.maps[0].occupancy.shape().is_planar());
    }

    #[test]
    fn objects_without_readings_or_origins_are_refused() {
        let none = mapped(&[], DVec3::ZERO, &GeometricConfig::planar());
        assert!(matches!(
            none,
            Err(GeometricTrainError::Readings(TrainingError::Map(MapError::TooFew {
                found: 0,
                ..
            })))
        ));
        let sensor = SensorDescription::digitacts_6x6();
        let set = TrainingSet { readings: &presses(0.0, 0.0), sensor: &sensor };
        let error = map_geometry(&[set], &[], &GeometricConfig::planar()).unwrap_err();
        assert_eq!(error, GeometricTrainError::Origins { expected: 1, found: 0 });
    }
}
