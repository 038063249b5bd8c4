//! A patch: a place of an object's surface as one training touch measured it.

use glam::Vec3;

use super::agreement::StoredFeature;

/// A patch of an object's surface, in the object frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePatch {
    /// Position, metres.
    pub position: Vec3,
    /// Outward normal, norm 1.
    pub normal: Vec3,
    /// Direction in which contacts are stretched, norm 1, without sign.
    pub direction: Vec3,
    /// Elongation of contacts, 0 to 1.
    pub elongation: f32,
    /// Deviation of the normals of touches, rad.
    pub normal_deviation: f32,
    /// Appearance, in the catalogue's [`super::AppearanceSpace`].
    pub feature: StoredFeature,
}
