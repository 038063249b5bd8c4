//! Support for the recogniser's tests: an ellipsoid's surface, and touches of it.

use std::sync::Arc;

use glam::{DQuat, DVec3, Vec3};
use palpate_core::descriptor::Descriptor as _;
use palpate_core::pose::Pose;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::SensorDescription;
use palpate_core::stop::Stop;
use palpate_core::vocabulary::discriminant::Discriminant;

use crate::model::agreement::N_AXES;
use crate::model::appearance::{AppearanceSpace, raw_descriptor};
use crate::model::calibration::EvidenceCalibration;
use crate::model::map::SurfaceLayout;
use crate::model::{SurfaceMap, SurfaceModel, SurfacePatch};
use crate::observe::inverse_pose::InversePose;
use crate::observe::observation::{Comparison, Observation};
use crate::observe::touch::Touch;
use crate::options::SurfaceOptions;
use crate::verify::density::Kernel;
use crate::verify::evidence::Evidence;

/// Half axes of the ellipsoid, metres.
const HALF_AXES: DVec3 = DVec3::new(0.040, 0.030, 0.020);

/// A place of the ellipsoid in the object frame, of the same appearance as all others.
pub(crate) fn on_ellipsoid(stream: &mut Stream) -> Touch {
    let on_sphere = stream.direction();
    let normal = (on_sphere / HALF_AXES).normalize();
    Touch {
        position: on_sphere * HALF_AXES,
        normal,
        direction: normal.any_orthonormal_vector(),
        sensor_x: normal.any_orthonormal_vector(),
        elongation: 0.0,
        evenness: 1.0,
        feature: [0.0; N_AXES],
        point: None,
        looseness: 0.0,
    }
}

/// `n` places of the ellipsoid, from a stream of their own.
pub(crate) fn places(n: usize, index: u64) -> Vec<Touch> {
    let mut stream = Stream::new(7, Purpose::Shape, index);
    (0..n).map(|_| on_ellipsoid(&mut stream)).collect()
}

/// The map of places.
pub(crate) fn map_of(places: &[Touch]) -> SurfaceMap {
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

/// A comparison under which all features are equal, also to those anywhere.
pub(crate) const COMPARISON: Comparison = Comparison { softness: 1.0, density: 1.0 };

/// Observation of a place by a session with the object at `session_from_object`.
pub(crate) fn seen(place: &Touch, session_from_object: &Pose) -> Observation {
    let touch = Touch {
        position: *session_from_object * place.position,
        normal: session_from_object.turn(place.normal),
        direction: session_from_object.turn(place.direction),
        sensor_x: session_from_object.turn(place.sensor_x),
        ..place.clone()
    };
    Observation::compared(&touch, DVec3::ZERO, COMPARISON, COMPARISON)
}

/// A pose of an object in a session: random rotation, half a metre away.
pub(crate) fn some_pose(index: u64) -> Pose {
    let mut stream = Stream::new(7, Purpose::ObjectPose, index);
    Pose::from_parts(stream.rotation(), 0.5 * stream.direction())
}

/// A pose in single precision.
pub(crate) fn single(pose: &Pose) -> (glam::Quat, Vec3) {
    (pose.rotation.as_quat(), pose.translation.as_vec3())
}

/// Error of a pose in single precision: metres, rad.
pub(crate) fn error(rotation: glam::Quat, translation: Vec3, truth: &Pose) -> (f64, f64) {
    let rotation = DQuat::from_array(rotation.to_array().map(f64::from));
    let found = Pose::from_parts(rotation, translation.as_dvec3());
    (found.distance_to(truth), found.angle_to(truth))
}

/// A space in which all appearances are equal.
pub(crate) fn space() -> AppearanceSpace {
    let grid = *SensorDescription::digitacts_6x6().grid();
    let dimension = raw_descriptor(&grid).dimension() + 1;
    let projection = Discriminant { mean: vec![0.0; dimension], axes: vec![vec![1.0; dimension]] };
    AppearanceSpace::new(grid, projection, vec![[0; N_AXES]])
}

/// A pose, inverted.
pub(crate) fn inverse(pose: &Pose) -> InversePose {
    let (rotation, translation) = single(pose);
    InversePose::new(rotation, translation)
}

/// A model of objects of such places, not calibrated.
pub(crate) fn model_of(objects: &[Vec<Touch>]) -> Arc<SurfaceModel> {
    let maps = objects.iter().map(|places| Arc::new(map_of(places))).collect();
    Arc::new(SurfaceModel::new(space(), EvidenceCalibration::default(), maps))
}

/// Observations of a session, with the parts that score poses by them.
pub(crate) struct Session {
    pub(crate) model: Arc<SurfaceModel>,
    pub(crate) options: SurfaceOptions,
    pub(crate) touches: Vec<Observation>,
    kernel: Kernel,
    stop: Stop,
}

impl Session {
    /// A session over these objects without observations.
    pub(crate) fn over(objects: &[Vec<Touch>], options: SurfaceOptions) -> Self {
        let (kernel, stop) = (Kernel::new(&options), Stop::never());
        Self { model: model_of(objects), options, touches: Vec::new(), kernel, stop }
    }

    /// Its evidence.
    pub(crate) fn evidence(&self) -> Evidence<'_> {
        let Self { model, options, touches, kernel, stop } = self;
        Evidence { maps: model.maps(), kernel, touches, spaces: &[], options, stop }
    }
}
