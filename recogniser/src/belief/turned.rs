//! Poses ready for look-ups, and touches seen from an object in one.

use glam::{Mat3, Quat, Vec3};

use super::sighting::Sighting;
use crate::surface::SurfaceMap;
use crate::surface::near::Near;

/// A pose ready for look-ups, relative to the session's anchor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Turned {
    pub(super) object_from_session: Mat3,
    pub(super) translation: Vec3,
}

impl Turned {
    pub(super) fn new(rotation: Quat, translation: Vec3) -> Self {
        Self { object_from_session: Mat3::from_quat(rotation.conjugate()), translation }
    }

    /// The angle of the turn between two poses, rad.
    pub(super) fn angle_to(&self, other: &Self) -> f32 {
        let turn = self.object_from_session.transpose() * other.object_from_session;
        let trace = turn.x_axis.x + turn.y_axis.y + turn.z_axis.z;
        (0.5 * (trace - 1.0)).clamp(-1.0, 1.0).acos()
    }

    /// A touch in the object frame.
    pub(super) fn contact(&self, touch: &Sighting) -> Contact {
        Contact {
            point: self.object_from_session * (touch.position - self.translation),
            normal: self.object_from_session * touch.normal,
            direction: self.object_from_session * touch.direction,
        }
    }
}

/// A touch in the object frame.
#[derive(Clone, Copy)]
pub(super) struct Contact {
    pub(super) point: Vec3,
    pub(super) normal: Vec3,
    pub(super) direction: Vec3,
}

/// A touch on a map: where, and which of the map's touches are near.
#[derive(Clone, Copy)]
pub(super) struct Met {
    pub(super) contact: Contact,
    pub(super) near: Near,
}

impl Met {
    #[inline]
    pub(super) fn new(map: &SurfaceMap, pose: &Turned, touch: &Sighting) -> Self {
        let contact = pose.contact(touch);
        Self { contact, near: map.voxels().near(contact.point) }
    }
}
