//! Inverse poses for look-ups, and touches transformed into the object frame.

use glam::{Mat3, Quat, Vec3};

use super::observation::Observation;
use crate::model::SurfaceMap;
use crate::model::near::Near;

/// A pose, inverted for look-ups on a map: a point p of the session lies at
/// `object_from_session · (p − translation)` of the object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct InversePose {
    pub(crate) object_from_session: Mat3,
    /// Object's origin in the session frame, relative to the anchor, metres.
    pub(crate) translation: Vec3,
    /// True place of the sensor relative to the stated one, sensor frame, metres (equation R21a).
    pub(crate) tool: Vec3,
}

impl InversePose {
    pub(crate) fn new(rotation: Quat, translation: Vec3) -> Self {
        let object_from_session = Mat3::from_quat(rotation.conjugate());
        Self { object_from_session, translation, tool: Vec3::ZERO }
    }

    /// Angle of the rotation between two poses, rad.
    pub(crate) fn angle_to(&self, other: &Self) -> f32 {
        let turn = self.object_from_session.transpose() * other.object_from_session;
        let trace = turn.x_axis.x + turn.y_axis.y + turn.z_axis.z;
        (0.5 * (trace - 1.0)).clamp(-1.0, 1.0).acos()
    }

    /// A point of the session in the object frame.
    #[inline]
    pub(crate) fn point(&self, point: Vec3) -> Vec3 {
        self.object_from_session * (point - self.translation)
    }

    /// An observation in the object frame.
    #[inline]
    pub(crate) fn touch(&self, observation: &Observation) -> TouchInObject {
        TouchInObject {
            point: self.point(observation.position_with(self.tool)),
            normal: self.object_from_session * observation.normal,
            direction: self.object_from_session * observation.direction,
        }
    }
}

/// A touch in the object frame.
#[derive(Clone, Copy)]
pub(crate) struct TouchInObject {
    pub(crate) point: Vec3,
    pub(crate) normal: Vec3,
    pub(crate) direction: Vec3,
}

/// A touch on a map: its place, and the patches near it.
#[derive(Clone, Copy)]
pub(crate) struct TouchOnMap {
    pub(crate) touch: TouchInObject,
    pub(crate) near: Near,
}

impl TouchOnMap {
    #[inline]
    pub(crate) fn new(map: &SurfaceMap, pose: &InversePose, observation: &Observation) -> Self {
        let touch = pose.touch(observation);
        Self { touch, near: map.voxels().near(touch.point) }
    }
}
