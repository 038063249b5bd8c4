//! Facets: patches with the curved surface about each, one cache line each.
//!
//! Poses are scored by touches anywhere on an object, so that the part of its map that is read
//! is rarely in the cache: in a large catalogue most time is memory latency. All that is read of
//! a patch is therefore packed into 64 bytes. For this, elongation and the variances of normals
//! are quantised, far more finely than their accuracy.

use glam::{Vec2, Vec3};

use super::agreement::StoredFeature;
use super::bend::{Bend, VARIANCE_MAX};
use super::patch::SurfacePatch;

/// Cap on the turn of the normal along the surface: tangent of the angle.
const TURN_MAX: f32 = 1.0;

/// Quantisation steps from 0 to the maximum.
const STEPS: f32 = u16::MAX as f32;

/// A patch of an object's surface and the curved surface about it, object frame.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(64))]
pub struct Facet {
    /// Position, metres.
    pub position: Vec3,
    /// Outward normal, norm 1.
    pub normal: Vec3,
    /// Direction in which contacts are stretched, norm 1, without sign.
    pub direction: Vec3,
    form: [f32; 3],
    /// Appearance, in the catalogue's [`super::AppearanceSpace`].
    pub feature: StoredFeature,
    elongation: u16,
    normal_variances: [u16; 2],
}

impl Facet {
    /// The facet of a patch and its bend.
    #[must_use]
    pub fn new(patch: &SurfacePatch, bend: &Bend) -> Self {
        let steps = |share: f32| (share * STEPS).round() as u16;
        Self {
            position: patch.position,
            normal: patch.normal,
            direction: patch.direction,
            form: bend.form,
            feature: patch.feature,
            elongation: steps(patch.elongation),
            normal_variances: bend.normal_variances.map(|variance| steps(variance / VARIANCE_MAX)),
        }
    }

    /// The facets of patches; `bends` are in their order.
    #[must_use]
    pub fn all(patches: &[SurfacePatch], bends: &[Bend]) -> Vec<Self> {
        patches.iter().zip(bends).map(|(patch, bend)| Self::new(patch, bend)).collect()
    }

    /// Elongation of contacts, 0 to 1.
    #[inline]
    #[must_use]
    pub fn elongation(&self) -> f32 {
        f32::from(self.elongation) * (1.0 / STEPS)
    }

    /// Scatter of normals about the expected one: variances of the tangent of their angle along
    /// the direction and across it, about rad².
    #[inline]
    #[must_use]
    pub fn normal_variances(&self) -> [f32; 2] {
        let [along, across] = self.normal_variances;
        [f32::from(along) * (VARIANCE_MAX / STEPS), f32::from(across) * (VARIANCE_MAX / STEPS)]
    }

    /// Total scatter of normals about the expected one, rad.
    #[inline]
    #[must_use]
    pub fn normal_deviation(&self) -> f32 {
        let [along, across] = self.normal_variances();
        (along + across).sqrt()
    }

    /// Height (m) of a point above the curved surface, and the surface's normal there; `off` is
    /// the point relative to the patch (m). Equation R4a of docs/recogniser.md.
    #[inline]
    #[must_use]
    pub fn surface_at(&self, off: Vec3) -> (f32, Vec3) {
        let [xx, xy, yy] = self.form;
        let across = self.normal.cross(self.direction);
        let (x, y) = (off.dot(self.direction), off.dot(across));
        let turn = Vec2::new(xx * x + xy * y, xy * x + yy * y);
        let fall = 0.5 * turn.dot(Vec2::new(x, y));
        let turn = turn.clamp(Vec2::splat(-TURN_MAX), Vec2::splat(TURN_MAX));
        let normal = self.normal + self.direction * turn.x + across * turn.y;
        (off.dot(self.normal) + fall, normal.normalize())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_facet_is_a_line_of_the_cache_and_keeps_what_it_rounds() {
        assert_eq!((size_of::<Facet>(), align_of::<Facet>()), (64, 64));
        for (elongation, variances) in [(0.0, [0.002_5, 0.25]), (1.0, [0.01, 0.1])] {
            let patch = SurfacePatch {
                position: Vec3::X,
                normal: Vec3::Y,
                direction: Vec3::Z,
                elongation,
                normal_deviation: 0.1,
                feature: [3; 8],
            };
            let facet = Facet::new(&patch, &Bend { form: [0.0; 3], normal_variances: variances });
            assert!((facet.elongation() - elongation).abs() < 1e-5);
            for (kept, variance) in facet.normal_variances().into_iter().zip(variances) {
                assert!((kept / variance - 1.0).abs() < 1e-3, "{kept} {variance}");
            }
            let deviation = (variances[0] + variances[1]).sqrt();
            assert!((facet.normal_deviation() / deviation - 1.0).abs() < 1e-3);
        }
    }
}
