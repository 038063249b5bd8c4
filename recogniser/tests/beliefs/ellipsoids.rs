//! Ellipsoids with varying contacts: analytic objects for tests of the recogniser.

use std::sync::{Arc, LazyLock};

use glam::{DMat3, DQuat, DVec3};
use palpate_core::pose::Pose;
use palpate_core::reading::{Reading, SensorId};
use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::SensorDescription;
use palpate_core::training::TrainingSet;
use palpate_core::units::MM;
use palpate_recogniser::belief::SurfaceBelief;
use palpate_recogniser::model::{EvidenceCalibration, SurfaceMap, SurfaceModel};
use palpate_recogniser::options::SurfaceOptions;
use palpate_recogniser::train::{SurfaceConfig, learn_space, map_surface};

pub(crate) const N_OBJECTS: usize = 3;

/// Half axes of the ellipsoids, metres.
pub(crate) const HALF_AXES: [DVec3; N_OBJECTS] = [
    DVec3::new(0.040, 0.020, 0.012),
    DVec3::new(0.040, 0.032, 0.014),
    DVec3::new(0.040, 0.015, 0.030),
];

pub(crate) fn six_by_six() -> SensorDescription {
    SensorDescription::digitacts_6x6()
}

/// A touch of an ellipsoid: a blob that is longest along the projection of the object's z axis
/// onto the surface, and whose size varies along x and y.
pub(crate) fn touch(object: usize, sensor: &SensorDescription, stream: &mut Stream) -> Reading {
    touch_of(HALF_AXES[object], sensor, stream)
}

/// The same of an ellipsoid with these half axes (m).
pub(crate) fn touch_of(half: DVec3, sensor: &SensorDescription, stream: &mut Stream) -> Reading {
    let on_sphere = stream.direction();
    let normal = (on_sphere / half).normalize();
    let along = (DVec3::Z - normal * normal.z).normalize_or(DVec3::X);
    // The sensor's frame before it is spun: x along the blob, z into the object.
    let facing = DQuat::from_mat3(&DMat3::from_cols(along, (-normal).cross(along), -normal));
    let spin = stream.uniform(0.0, std::f64::consts::TAU);
    let (width, height) = (3.4 + 1.6 * on_sphere.x, 2.0 + 0.9 * on_sphere.y);
    let pressures: Vec<Option<f64>> = (0..sensor.grid().n_taxels())
        .map(|taxel| {
            let (x, y) =
                sensor.grid().center(taxel / sensor.grid().cols, taxel % sensor.grid().cols);
            let (sin, cos) = spin.sin_cos();
            let (u, v) = ((cos * x - sin * y) / MM / width, (sin * x + cos * y) / MM / height);
            Some(12_000.0 * (-0.5 * (u * u + v * v)).exp() + 40.0 * stream.normal())
        })
        .collect();
    let pose = Pose::from_parts(facing * DQuat::from_rotation_z(spin), on_sphere * half);
    Reading::new(SensorId(0), sensor, &pressures, pose).unwrap()
}

pub(crate) fn touches(object: usize, n: usize, seed: u64) -> Vec<Reading> {
    let mut stream = Stream::new(seed, Purpose::Sampling, object as u64);
    (0..n).map(|_| touch(object, &six_by_six(), &mut stream)).collect()
}

pub(crate) static MODEL: LazyLock<Arc<SurfaceModel>> = LazyLock::new(|| {
    let sensor = six_by_six();
    let readings: Vec<Vec<Reading>> =
        (0..N_OBJECTS).map(|object| touches(object, 600, 1)).collect();
    let sets: Vec<TrainingSet<'_>> =
        readings.iter().map(|readings| TrainingSet { readings, sensor: &sensor }).collect();
    let space = learn_space(&sets, 1).unwrap();
    let config = SurfaceConfig::default();
    let map = |set| Arc::new(map_surface(set, &space, &config, Some(DVec3::ZERO)).unwrap());
    let maps = sets.iter().map(map).collect();
    Arc::new(SurfaceModel::new(space, EvidenceCalibration::default(), maps))
});

pub(crate) fn belief() -> SurfaceBelief {
    SurfaceBelief::new(MODEL.clone(), SurfaceOptions::default(), None).unwrap()
}

pub(crate) fn recognise(object: usize, session_from_object: Pose, n: usize) -> SurfaceBelief {
    let mut belief = belief();
    for reading in touches(object, n, 2) {
        belief.add(&reading.moved_by(session_from_object), &six_by_six());
    }
    belief
}

pub(crate) fn some_pose(index: u64) -> Pose {
    let mut stream = Stream::new(3, Purpose::ObjectPose, index);
    Pose::from_parts(stream.rotation(), 0.5 * stream.direction())
}

/// The map of an object, in the appearance space of [`MODEL`].
pub(crate) fn map_of(readings: &[Reading]) -> Arc<SurfaceMap> {
    let set = TrainingSet { readings, sensor: &six_by_six() };
    let config = SurfaceConfig::default();
    Arc::new(map_surface(&set, &MODEL.space, &config, Some(DVec3::ZERO)).unwrap())
}
