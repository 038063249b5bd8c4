//! What the tests of the surface recogniser share: an ellipsoid's surface, and touches of it.

use std::sync::Arc;

use glam::{DQuat, DVec3, Vec3};

use super::sighting::{Looks, Sighting};
use super::{SurfaceBelief, SurfaceOptions};
use crate::model::{EvidenceCalibration, SurfaceModel};
use crate::surface::appearance::{N_AXES, raw_descriptor};
use crate::surface::map::SurfaceLayout;
use crate::surface::{AppearanceSpace, SurfaceMap, SurfacePatch, Touch};
use palpate_core::descriptor::Descriptor as _;
use palpate_core::pose::Pose;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::SensorDescription;
use palpate_core::vocabulary::discriminant::Discriminant;

/// Half axes of the ellipsoid, metres.
const HALF_AXES: DVec3 = DVec3::new(0.040, 0.030, 0.020);

/// A place of the ellipsoid in the object frame that looks like everywhere else.
pub(super) fn on_ellipsoid(stream: &mut Stream) -> Touch {
    let on_sphere = stream.direction();
    let normal = (on_sphere / HALF_AXES).normalize();
    Touch {
        position: on_sphere * HALF_AXES,
        normal,
        direction: normal.any_orthonormal_vector(),
        elongation: 0.0,
        evenness: 1.0,
        feature: [0.0; N_AXES],
    }
}

/// `n` places of the ellipsoid, from a stream of their own.
pub(super) fn places(n: usize, index: u64) -> Vec<Touch> {
    let mut stream = Stream::new(7, Purpose::Shape, index);
    (0..n).map(|_| on_ellipsoid(&mut stream)).collect()
}

/// The map of places.
pub(super) fn map_of(places: &[Touch]) -> SurfaceMap {
    let patch = |touch: &Touch| SurfacePatch {
        position: touch.position.as_vec3(),
        normal: touch.normal.as_vec3(),
        direction: touch.direction.as_vec3(),
        elongation: touch.elongation as f32,
        normal_deviation: 0.1,
        feature: [0; N_AXES],
    };
    let patches = places.iter().map(patch).collect();
    SurfaceMap::new(DVec3::ZERO, patches, SurfaceLayout::default())
}

/// All features alike, and alike to those anywhere.
pub(super) const LOOKS: Looks = Looks { softness: 1.0, density: 1.0 };

/// What a session sees of a place when the object is at `session_from_object`.
pub(super) fn seen(place: &Touch, session_from_object: &Pose) -> Sighting {
    let touch = Touch {
        position: *session_from_object * place.position,
        normal: session_from_object.turn(place.normal),
        direction: session_from_object.turn(place.direction),
        ..place.clone()
    };
    Sighting::with_looks(&touch, DVec3::ZERO, LOOKS, LOOKS)
}

/// A pose like that of an object in a session: turned by anything, half a metre away.
pub(super) fn some_pose(index: u64) -> Pose {
    let mut stream = Stream::new(7, Purpose::ObjectPose, index);
    Pose::from_parts(stream.rotation(), 0.5 * stream.direction())
}

/// A pose in single precision.
pub(super) fn single(pose: &Pose) -> (glam::Quat, Vec3) {
    (pose.rotation.as_quat(), pose.translation.as_vec3())
}

/// How far a pose in single precision is from another: metres, rad.
pub(super) fn error(rotation: glam::Quat, translation: Vec3, truth: &Pose) -> (f64, f64) {
    let rotation = DQuat::from_array(rotation.to_array().map(f64::from));
    let found = Pose::from_parts(rotation, translation.as_dvec3());
    (found.distance_to(truth), found.angle_to(truth))
}

/// A space in which everything looks alike.
pub(super) fn space() -> AppearanceSpace {
    let grid = *SensorDescription::digitacts_6x6().grid();
    let dimension = raw_descriptor(&grid).dimension() + 1;
    let projection = Discriminant { mean: vec![0.0; dimension], axes: vec![vec![1.0; dimension]] };
    AppearanceSpace::new(grid, projection, vec![[0; N_AXES]])
}

/// The belief of nothing yet over objects of such places.
pub(super) fn belief_over(objects: &[Vec<Touch>], options: SurfaceOptions) -> SurfaceBelief {
    let maps = objects.iter().map(|places| Arc::new(map_of(places))).collect();
    let model = SurfaceModel::new(space(), EvidenceCalibration::default(), maps);
    SurfaceBelief::new(Arc::new(model), options, None).unwrap()
}
