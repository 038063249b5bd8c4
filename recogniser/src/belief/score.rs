//! How well a pose explains a touch: the density of the touch under an object's map, relative
//! to "anywhere in the workspace, any way round, any appearance".
//!
//! A touch near the surface is explained by the mapped touches near it, in the mean over all of
//! the map: a few of them stand for the others (`surface::near`). Each has the surface bent
//! about it: a Gaussian across and along the surface, von Mises–Fisher in the normal (some
//! normals say little), von Mises in the double angle of the stretch, times the ratio of the
//! appearance. Touches that fit nowhere keep the share of outliers, so that nothing ever dies.
//! Results are ln.

use glam::{Vec2, Vec3};

use super::options::{RefinementScale, SurfaceOptions};
use super::sighting::Sighting;
use super::stretch::aligned;
use super::turned::{Contact, Met, Turned};
use crate::surface::SurfaceMap;
use crate::surface::facet::Facet;
use palpate_core::exponential::exp;

/// Touches are taken to be explained no better than this (ln) when hopeless poses are given up.
/// It is no strict bound: a rare look on a map of few touches can exceed it.
const SCORE_MAX: f32 = 14.0;

/// Beyond this (squared distance in deviations) a mapped touch explains nothing: e⁻¹⁸ of what it
/// would explain at its own place.
const FAR: f32 = 36.0;

/// Patches that face this far away (cosine) say nothing of the height of the surface.
const FACING_MIN: f32 = 0.3;

/// The kernel of a touch about the touches of a map, prepared.
#[derive(Clone, Copy, Debug)]
pub(super) struct Kernel {
    across: f32,
    along: f32,
    normal_variance: f32,
    normal_outliers: f32,
    direction: f32,
    outliers: f32,
    /// Workspace volume times the peak of the Gaussian across, times 1 − outliers.
    peak: f32,
    refinement: RefinementScale,
}

/// How wide the kernel of one touch is: inverse variances across and along the surface (m⁻²),
/// and the variance of its normal (rad²).
#[derive(Clone, Copy)]
struct Width {
    across: f32,
    along: f32,
    normal_variance: f32,
}

/// Where on a map a touch is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// From the surface to the touch, object frame, metres.
    pub(super) offset: Vec3,
    /// The surface's normal there.
    pub(super) normal: Vec3,
    /// How far normals scatter there, rad.
    pub(super) normal_deviation: f32,
}

impl Kernel {
    pub(super) fn new(options: &SurfaceOptions) -> Self {
        let scale = &options.scale;
        let peak = std::f32::consts::TAU.powf(-1.5) / scale.across;
        Self {
            across: scale.across.powi(-2),
            along: scale.along,
            normal_variance: scale.normal.powi(2),
            normal_outliers: scale.normal_outliers,
            direction: scale.direction,
            outliers: scale.outliers,
            peak: (1.0 - scale.outliers) * scale.workspace * peak,
            refinement: options.refinement,
        }
    }

    /// The score of a touch that fits nowhere.
    pub(super) fn floor_of(&self, touch: &Sighting) -> f32 {
        touch.weight * (self.outliers + touch.astray).ln()
    }

    /// The inverse variance along a map's surface: touches of a map that lie far apart explain
    /// what lies between them.
    #[inline]
    pub(super) fn along(&self, map: &SurfaceMap) -> f32 {
        self.along.max(map.spacing()).powi(-2)
    }

    /// How wide a touch's kernel is on a map.
    #[inline]
    fn about(&self, map: &SurfaceMap, touch: &Sighting) -> Width {
        let (across, along) = (self.across, self.along(map));
        let normal_variance = self.normal_variance + touch.steadiness.normal_variance;
        if touch.placement.is_exact() {
            return Width { across, along, normal_variance };
        }
        let (position, angle) = touch.looseness();
        let wider = |inverse: f32| (inverse.recip() + position).recip();
        let normal_variance = normal_variance + angle;
        Width { across: wider(across), along: wider(along), normal_variance }
    }

    /// The score of one touch under a pose.
    #[inline]
    pub(super) fn score(&self, map: &SurfaceMap, pose: &Turned, touch: &Sighting) -> f32 {
        // No map has so many patches.
        self.score_without(map, pose, touch, usize::MAX)
    }

    /// The same as if the map had no patch `left_out`.
    #[inline]
    pub(super) fn score_without(
        &self,
        map: &SurfaceMap,
        pose: &Turned,
        touch: &Sighting,
        left_out: usize,
    ) -> f32 {
        self.score_met(map, &Met::new(map, pose, touch), touch, left_out)
    }

    /// What touches score together under each of `poses`. All are looked up on the map before
    /// any is scored: the memory answers for several at once.
    pub(super) fn score_each(
        &self,
        map: &SurfaceMap,
        poses: &[Turned],
        touches: &[&Sighting],
    ) -> Vec<f32> {
        let mut met = Vec::with_capacity(poses.len() * touches.len());
        for pose in poses {
            met.extend(touches.iter().map(|touch| Met::new(map, pose, touch)));
        }
        let of_pose = |pose: usize| {
            let met = met[pose * touches.len()..].iter().zip(touches);
            met.map(|(met, touch)| self.score_met(map, met, touch, usize::MAX)).sum()
        };
        (0..poses.len()).map(of_pose).collect()
    }

    #[inline]
    fn score_met(&self, map: &SurfaceMap, met: &Met, touch: &Sighting, left_out: usize) -> f32 {
        let facets = map.facets();
        let scale = self.about(map, touch);
        let mut sum = 0.0;
        let mut kept = 1.0;
        for (index, stands_for) in met.near.weighed() {
            if usize::from(index) == left_out {
                // Those that it stood for are stood for by the others.
                let n_meant = met.near.n_meant();
                kept = (n_meant - stands_for) / (n_meant - 1.0).max(1.0);
                continue;
            }
            let facet = &facets[usize::from(index)];
            let kernel = self.kernel(scale, facet, &met.contact, touch);
            if kernel > 0.0 {
                sum += stands_for * kernel * touch.appearance_of_pose(&facet.feature);
            }
        }
        let sum = if kept > 0.0 { sum / kept } else { sum };
        let peak = self.peak * scale.along * (scale.across / self.across).sqrt();
        let peak = peak / facets.len() as f32;
        touch.weight * (peak * sum + self.outliers + touch.astray).ln()
    }

    /// The score of touches, one after the other; given up (`None`) once it cannot reach `bar`.
    #[inline]
    pub(super) fn score_all<'a>(
        &self,
        map: &SurfaceMap,
        pose: &Turned,
        touches: impl ExactSizeIterator<Item = &'a Sighting>,
        bar: f32,
    ) -> Option<f32> {
        let (mut sum, mut left) = (0.0, touches.len());
        for touch in touches {
            sum += self.score(map, pose, touch);
            left -= 1;
            if sum + left as f32 * SCORE_MAX < bar {
                return None;
            }
        }
        Some(sum)
    }

    /// Where on the map a touch is: the mean of the mapped touches that may explain it, laid
    /// onto the surface between them. `None` away from the surface.
    pub(super) fn place(&self, map: &SurfaceMap, pose: &Turned, touch: &Sighting) -> Option<Place> {
        let Met { contact, near } = Met::new(map, pose, touch);
        let (mut offset, mut normal, mut deviation, mut total) = (Vec3::ZERO, Vec3::ZERO, 0.0, 0.0);
        let (mut height, mut heights) = (0.0, 0.0);
        // As wide across as along: what matters is which patches, not how high.
        let scale = self.about(map, touch);
        let scale = Width { across: scale.along, ..scale };
        for index in near.touches() {
            let facet = &map.facets()[usize::from(index)];
            let kernel = self.kernel(scale, facet, &contact, touch);
            let weight = kernel * touch.appearance_of_pose(&facet.feature) + 1e-12;
            let off = contact.point - facet.position;
            let (above, outward) = facet.surface_at(off);
            normal += weight * outward;
            offset += weight * off;
            deviation += weight * facet.normal_deviation();
            total += weight;
            // The height above the surface about each patch, not above the mean of their positions.
            let agreement = facet.normal.dot(contact.normal);
            if agreement >= FACING_MIN {
                let flat = off.length_squared() - off.dot(facet.normal).powi(2);
                let smoothing = self.refinement.smoothing.powi(2);
                let weight = exp(-flat / smoothing) * agreement + 1e-6;
                height += weight * above;
                heights += weight;
            }
        }
        if total <= 0.0 || heights <= 0.0 {
            return None;
        }
        let normal = normal.normalize_or_zero();
        let offset = offset / total;
        let offset = offset + normal * (height / heights - offset.dot(normal));
        Some(Place { offset, normal, normal_deviation: deviation / total })
    }

    #[inline]
    fn kernel(&self, width: Width, facet: &Facet, contact: &Contact, touch: &Sighting) -> f32 {
        let off = contact.point - facet.position;
        let (height, normal) = facet.surface_at(off);
        let flat = off.length_squared() - off.dot(facet.normal).powi(2);
        let spatial = height * height * width.across + flat * width.along;
        if spatial > FAR {
            return 0.0;
        }
        // Gauss in the two ways in which the normal may be turned, along the stretch and across
        // it, relative to an even distribution of normals: 2/(σ₁σ₂) exp(−½…); of normals that say
        // little ¾ (1 + cos)², which faces about the same way.
        let cosine = normal.dot(contact.normal);
        let mut facing = self.normal_outliers * 0.75 * (1.0 + cosine) * (1.0 + cosine);
        if cosine > 0.0 {
            let turned = contact.normal - normal;
            let across = facet.normal.cross(facet.direction);
            let turned = Vec2::new(turned.dot(facet.direction), turned.dot(across));
            let variances = Vec2::from(facet.normal_variances()) + width.normal_variance;
            let peak = 2.0 / (variances.x * variances.y).sqrt();
            let misfit = (turned * turned / variances).element_sum();
            facing += (1.0 - self.normal_outliers) * peak * exp(-0.5 * misfit);
        }
        let stretch = self.direction * facet.elongation() * touch.elongation;
        let cosine = contact.direction.dot(facet.direction);
        let aligned = aligned(stretch, cosine, touch.steadiness.stretch_outliers);
        facing * aligned * exp(-0.5 * spatial)
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::belief::test_support::{map_of, places, seen, single, some_pose};
    use crate::surface::Touch;
    use palpate_core::pose::Pose;

    fn turned(pose: &Pose) -> Turned {
        let (rotation, translation) = single(pose);
        Turned::new(rotation, translation)
    }

    #[test]
    fn a_touch_on_the_only_patch_scores_as_computed_by_hand() {
        // 0.99 · 0.064 m³ / ((2π)^1.5 · 0.7 mm · (4 mm)²) = 3.592e5; of the normal
        // 0.95 · 2/(0.1² + 0.07²) + 0.05 · ¾ · 2² = 127.67; appearance 0.95/1 + 0.05 = 1:
        // ln(3.592e5 · 127.67 + 0.01) = 17.641.
        let place = places(1, 0);
        let kernel = Kernel::new(&SurfaceOptions::default());
        let pose = some_pose(0);
        let score = kernel.score(&map_of(&place), &turned(&pose), &seen(&place[0], &pose));
        assert!((score - 17.641).abs() < 0.02, "{score}");
    }

    #[test]
    fn a_touch_that_stands_wrongly_on_its_place_loses_less_than_one_that_fits_nowhere() {
        let kernel = Kernel::new(&SurfaceOptions::default());
        let mut place = places(1, 0);
        let map = map_of(&place);
        let pose = some_pose(0);
        // A right angle off, as at an edge: of the normal 0.05 · ¾ (1 + 0)² = 0.0375 is left:
        // ln(3.592e5 · 0.0375 + 0.01) = 9.508.
        place[0].normal = place[0].normal.any_orthonormal_vector();
        let score = kernel.score(&map, &turned(&pose), &seen(&place[0], &pose));
        assert!((score - 9.508).abs() < 0.02, "{score}");
    }

    #[test]
    fn a_normal_turned_about_a_ridge_costs_less_than_one_turned_along_it() {
        let touch = |y: f64, normal: DVec3| {
            let position = DVec3::Y * y;
            Touch { position, normal, direction: DVec3::Y, ..places(1, 0).remove(0) }
        };
        let side = |turn: f64| DVec3::new(turn.sin(), 0.0, turn.cos());
        let ridge = (0..20).map(|n| touch(0.002 * f64::from(n), side(0.4 * f64::from(n % 2))));
        let map = map_of(&ridge.collect::<Vec<_>>());
        let (kernel, pose) = (Kernel::new(&SurfaceOptions::default()), some_pose(0));
        // 0.3 rad off the middle of the two ways in which the touches stand.
        let about = touch(0.020, side(0.5));
        let along = touch(0.020, DVec3::new(0.2, 0.3, 1.0).normalize());
        let [about, along] =
            [about, along].map(|t| kernel.score(&map, &turned(&pose), &seen(&t, &pose)));
        assert!(about > along + 2.0, "{about} {along}");
    }

    #[test]
    fn a_normal_turned_in_an_uneven_press_costs_less() {
        let map = map_of(&places(400, 0));
        let (kernel, pose) = (Kernel::new(&SurfaceOptions::default()), some_pose(0));
        let lost = |evenness: f64| {
            let straight = Touch { evenness, ..places(1, 0).remove(0) };
            let across = straight.normal.any_orthonormal_vector();
            let normal = (straight.normal + 0.5 * across).normalize();
            let leaning = Touch { normal, ..straight.clone() };
            let score = |touch| kernel.score(&map, &turned(&pose), &seen(touch, &pose));
            score(&straight) - score(&leaning)
        };
        assert!(lost(0.9) > 3.0 * lost(0.3), "{} {}", lost(0.9), lost(0.3));
    }

    #[test]
    fn away_from_the_object_the_share_of_outliers_stays() {
        let kernel = Kernel::new(&SurfaceOptions::default());
        let map = map_of(&places(200, 0));
        let pose = some_pose(0);
        let mut place = places(1, 1).remove(0);
        place.position *= 3.0;
        let mut sighting = seen(&place, &pose);
        assert!((kernel.score(&map, &turned(&pose), &sighting) - 0.01f32.ln()).abs() < 1e-5);
        assert!((kernel.floor_of(&sighting) - 0.01f32.ln()).abs() < 1e-6);
        assert!(kernel.place(&map, &turned(&pose), &sighting).is_none());
        sighting.weight = 0.25;
        let quarter = 0.25 * 0.01f32.ln();
        assert!((kernel.score(&map, &turned(&pose), &sighting) - quarter).abs() < 1e-5);
    }

    #[test]
    fn all_touches_score_as_one_by_one_unless_hopeless() {
        let kernel = Kernel::new(&SurfaceOptions::default());
        let map = map_of(&places(500, 0));
        let (truth, wrong) = (some_pose(0), some_pose(1));
        let touches: Vec<Sighting> = places(6, 1).iter().map(|p| seen(p, &truth)).collect();
        let pose = turned(&truth);
        let sum: f32 = touches.iter().map(|touch| kernel.score(&map, &pose, touch)).sum();
        let all = kernel.score_all(&map, &pose, touches.iter(), 0.0).unwrap();
        assert!((all - sum).abs() < 1e-3 * sum, "{all} {sum}");
        assert!(sum > 6.0 * 5.0, "{sum}");
        assert_eq!(kernel.score_all(&map, &turned(&wrong), touches.iter(), sum - 12.0), None);
        let floor = 6.0 * kernel.floor_of(&touches[0]);
        let hopeless = kernel.score_all(&map, &turned(&wrong), touches.iter(), f32::NEG_INFINITY);
        assert!(hopeless.unwrap() < floor + 20.0);
    }

    #[test]
    fn poses_looked_up_together_score_as_one_by_one() {
        let kernel = Kernel::new(&SurfaceOptions::default());
        let map = map_of(&places(500, 0));
        let poses = [0, 1, 0, 2].map(|index| turned(&some_pose(index)));
        let touches: Vec<Sighting> = places(3, 1).iter().map(|p| seen(p, &some_pose(0))).collect();
        let touches: Vec<&Sighting> = touches.iter().collect();
        let alone = |pose| touches.iter().map(|touch| kernel.score(&map, pose, touch)).sum();
        let alone: Vec<f32> = poses.iter().map(alone).collect();
        assert_eq!(kernel.score_each(&map, &poses, &touches), alone);
        assert!(alone[0] > alone[1] + 10.0, "{alone:?}");
    }

    #[test]
    fn a_touch_above_a_plane_is_placed_as_high_as_it_is() {
        let kernel = Kernel::new(&SurfaceOptions::default());
        let flat = |x: f64, y: f64, z: f64| Touch {
            position: DVec3::new(x, y, z) * 0.001,
            normal: DVec3::Z,
            direction: DVec3::X,
            ..places(1, 0).remove(0)
        };
        let grid = (0..400).map(|n| flat(f64::from(n % 20), f64::from(n / 20), 0.0));
        let map = map_of(&grid.collect::<Vec<_>>());
        let pose = some_pose(2);
        let place = kernel.place(&map, &turned(&pose), &seen(&flat(9.3, 10.4, 0.8), &pose));
        let place = place.unwrap();
        assert!((place.offset.z - 0.000_8).abs() < 1e-6, "{}", place.offset);
        assert!(place.normal.distance(Vec3::Z) < 1e-5);
        // The touches nearest to the middle of the voxel, which may be 2.6 mm away.
        assert!(place.offset.truncate().length() < 0.002_6, "{}", place.offset);
        // A plane touched every millimetre scatters as little as any: 0.05 rad both ways.
        assert!((place.normal_deviation - 0.05 * 2f32.sqrt()).abs() < 1e-4);
    }
}
