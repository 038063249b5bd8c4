//! A hypothesis: a pose of an object and its score.

use glam::{DQuat, DVec3, Quat, Vec3};
use palpate_core::pose::Pose;

use crate::observe::inverse_pose::InversePose;

/// A pose of an object, relative to the session's anchor, and its score.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hypothesis {
    pub(crate) rotation: Quat,
    pub(crate) translation: Vec3,
    /// δ of equation R21a: where the sensor truly is relative to its stated place, in the sensor
    /// frame, metres.
    pub(crate) tool: Vec3,
    /// S_h of equation R17: ln density of all observations.
    pub(crate) score: f32,
}

impl Hypothesis {
    /// A hypothesis with a right tool centre.
    pub(crate) fn new(rotation: Quat, translation: Vec3, score: f32) -> Self {
        Self { rotation, translation, tool: Vec3::ZERO, score }
    }

    /// The inverse pose for look-ups.
    pub(crate) fn inverse_pose(&self) -> InversePose {
        InversePose { tool: self.tool, ..InversePose::new(self.rotation, self.translation) }
    }

    /// `session_from_object` of a session with this anchor.
    pub(crate) fn session_from_object(&self, anchor: DVec3) -> Pose {
        let rotation = DQuat::from_array(self.rotation.to_array().map(f64::from));
        Pose::from_parts(rotation, anchor + self.translation.as_dvec3())
    }
}
