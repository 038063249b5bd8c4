//! A touch as the recogniser keeps it: single precision about the session's anchor.

use glam::{DVec3, Vec3};

use crate::surface::Touch;
use crate::surface::appearance::{Feature, StoredFeature, ratio};

/// Touches of one place agree: nearer ones than this (m) are no independent evidence.
const SAME_PLACE: f32 = 0.003;

/// A turn of the normal by a radian counts as this many metres apart.
const NORMAL_REACH: f32 = 0.006;

/// What a touch at the place of an earlier one still counts.
const REPEATED: f32 = 0.25;

/// A touch of the session, relative to the anchor (its first touch).
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Sighting {
    pub(super) position: Vec3,
    pub(super) normal: Vec3,
    pub(super) direction: Vec3,
    pub(super) elongation: f32,
    /// How much its evidence counts: 1 for a new place, less where it was touched before.
    pub(super) weight: f32,
    feature: Feature,
    /// How dense touches anywhere are at the feature.
    density: f32,
    softness: f32,
}

impl Sighting {
    /// A touch; `density` is how dense touches anywhere are at its feature.
    pub(super) fn new(touch: &Touch, anchor: DVec3, density: f32, softness: f32) -> Self {
        Self {
            position: (touch.position - anchor).as_vec3(),
            normal: touch.normal.as_vec3(),
            direction: touch.direction.as_vec3(),
            elongation: touch.elongation as f32,
            weight: 1.0,
            feature: touch.feature,
            density,
            softness,
        }
    }

    /// The touch with what it counts beside `earlier` ones.
    pub(super) fn weighed(mut self, earlier: &[Self]) -> Self {
        let apart = |other: &Self| {
            let turned = NORMAL_REACH * self.normal.distance(other.normal);
            self.position.distance(other.position).hypot(turned)
        };
        let nearest = earlier.iter().map(apart).fold(f32::INFINITY, f32::min);
        self.weight = (nearest / SAME_PLACE).clamp(REPEATED, 1.0);
        self
    }

    /// How much likelier the touch looks as it does where `other` was felt than anywhere.
    #[inline]
    pub(super) fn appearance(&self, other: &StoredFeature) -> f32 {
        ratio(&self.feature, other, self.softness, self.density)
    }
}
