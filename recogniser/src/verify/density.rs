//! The density of a touch under a pose (equation R4), fast: few patches, single precision.
//!
//! The density is the mean over all patches of the map. Only patches near the touch contribute,
//! and a few of them represent the others (`model::near`, equation R8).
//! [`reference`](super::reference) is the same without look-up. Scores are ln.

use glam::{Vec2, Vec3};
use palpate_core::exponential::exp;

use crate::model::SurfaceMap;
use crate::model::facet::Facet;
use crate::observe::inverse_pose::{InversePose, TouchInObject, TouchOnMap};
use crate::observe::observation::{Observation, Says};
use crate::observe::stretch::stretch_ratio;
use crate::options::{RefinementScale, SurfaceOptions};

/// Squared deviations beyond which a patch is ignored: its density is below e⁻¹⁸ of the peak.
const FAR: f32 = 36.0;

/// Factor of (1 + cosine)² with a mean of 1 over all directions.
const FACING: f32 = 0.75;

/// The kernel of a touch about the patches of a map, prepared.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Kernel {
    across: f32,
    along: f32,
    normal_variance: f32,
    normal_outliers: f32,
    direction: f32,
    outliers: f32,
    /// Workspace volume times the peak of the Gaussian across, times 1 − outliers.
    peak: f32,
    /// [`ScoreScale::touch_max`](crate::options::ScoreScale::touch_max).
    touch_max: f32,
    pub(crate) refinement: RefinementScale,
}

/// Widths of the kernel of one touch: inverse variances across and along the surface (m⁻²), and
/// the variance of its normal (rad²).
#[derive(Clone, Copy)]
pub(crate) struct Width {
    pub(crate) across: f32,
    pub(crate) along: f32,
    pub(crate) normal_variance: f32,
}

impl Kernel {
    pub(crate) fn new(options: &SurfaceOptions) -> Self {
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
            touch_max: options.score.touch_max,
            refinement: options.refinement,
        }
    }

    /// The score (ln) of a touch that fits nowhere: a factor of the last term of equation R17.
    pub(crate) fn floor_of(&self, touch: &Observation) -> f32 {
        touch.weight * (self.outliers + touch.off_object).ln()
    }

    /// The inverse variance along a map's surface; widely spaced patches have a wider kernel,
    /// which covers the surface between them.
    #[inline]
    pub(crate) fn along(&self, map: &SurfaceMap) -> f32 {
        self.along.max(map.spacing()).powi(-2)
    }

    /// The widths of a touch's kernel on a map.
    #[inline]
    pub(crate) fn width(&self, map: &SurfaceMap, touch: &Observation) -> Width {
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
    pub(crate) fn score(&self, map: &SurfaceMap, pose: &InversePose, touch: &Observation) -> f32 {
        // No map has this many patches.
        self.score_without(map, pose, touch, usize::MAX)
    }

    /// The score as if the map had no patch `left_out`.
    #[inline]
    pub(crate) fn score_without(
        &self,
        map: &SurfaceMap,
        pose: &InversePose,
        touch: &Observation,
        left_out: usize,
    ) -> f32 {
        let width = self.width(map, touch);
        self.score_on_map(map, &TouchOnMap::new(map, pose, touch), touch, width, left_out)
    }

    /// The score of one touch under a pose that stands for others about it: `more` has the
    /// variances by which they differ at the touch, of its height above the surface (m²) and of its
    /// normal (rad²).
    pub(crate) fn score_about(
        &self,
        map: &SurfaceMap,
        pose: &InversePose,
        touch: &Observation,
        more: [f32; 2],
    ) -> f32 {
        let Width { across, along, normal_variance } = self.width(map, touch);
        let across = (across.recip() + more[0]).recip();
        let width = Width { across, along, normal_variance: normal_variance + more[1] };
        self.score_on_map(map, &TouchOnMap::new(map, pose, touch), touch, width, usize::MAX)
    }

    /// The sum of the scores of touches under each of `poses`. All are looked up on the map before
    /// any is scored, so that their memory is fetched together.
    pub(crate) fn score_each(
        &self,
        map: &SurfaceMap,
        poses: &[InversePose],
        touches: &[&Observation],
    ) -> Vec<f32> {
        let mut on_map = Vec::with_capacity(poses.len() * touches.len());
        for pose in poses {
            on_map.extend(touches.iter().map(|touch| TouchOnMap::new(map, pose, touch)));
        }
        let of_pose = |pose: usize| {
            let on_map = on_map[pose * touches.len()..].iter().zip(touches);
            let score = |(found, touch): (&TouchOnMap, &&Observation)| {
                self.score_on_map(map, found, touch, self.width(map, touch), usize::MAX)
            };
            on_map.map(score).sum()
        };
        (0..poses.len()).map(of_pose).collect()
    }

    /// Equations R4 and R8 of docs/recogniser.md.
    #[inline]
    fn score_on_map(
        &self,
        map: &SurfaceMap,
        found: &TouchOnMap,
        touch: &Observation,
        width: Width,
        left_out: usize,
    ) -> f32 {
        let facets = map.facets();
        let mut sum = 0.0;
        let mut kept = 1.0;
        for (index, stands_for) in found.near.weighed() {
            if usize::from(index) == left_out {
                // The other patches take over the number that it represented.
                let n_meant = found.near.n_meant();
                kept = (n_meant - stands_for) / (n_meant - 1.0).max(1.0);
                continue;
            }
            let facet = &facets[usize::from(index)];
            let density = self.patch_density(width, facet, &found.touch, touch);
            if density > 0.0 {
                sum += stands_for * density * touch.appearance_ratio_of_pose(&facet.feature);
            }
        }
        let sum = if kept > 0.0 { sum / kept } else { sum };
        let peak = self.peak * width.along * (width.across / self.across).sqrt();
        let peak = peak / facets.len() as f32;
        touch.weight * (peak * sum + self.outliers + touch.off_object).ln()
    }

    /// The score of touches, one after the other; `None` once it cannot reach `bar`.
    #[inline]
    pub(crate) fn score_all<'a>(
        &self,
        map: &SurfaceMap,
        pose: &InversePose,
        touches: impl ExactSizeIterator<Item = &'a Observation>,
        bar: f32,
    ) -> Option<f32> {
        let (mut sum, mut left) = (0.0, touches.len());
        for touch in touches {
            sum += self.score(map, pose, touch);
            left -= 1;
            if sum + left as f32 * self.touch_max < bar {
                return None;
            }
        }
        Some(sum)
    }

    /// The density of a touch about one patch, without its peak and its appearance: the summand of
    /// equation R4 but for A.
    #[inline]
    pub(crate) fn patch_density(
        &self,
        width: Width,
        facet: &Facet,
        at: &TouchInObject,
        touch: &Observation,
    ) -> f32 {
        let off = at.point - facet.position;
        let (height, normal) = facet.surface_at(off);
        let flat = off.length_squared() - off.dot(facet.normal).powi(2);
        let spatial = height * height * width.across + flat * width.along;
        if spatial > FAR {
            return 0.0;
        }
        self.directions(width, facet, normal, at, touch) * exp(-0.5 * spatial)
    }

    /// Density of a touch's normal and stretch about a patch where its surface has this `normal`:
    /// N D of equation R4.
    #[inline]
    pub(crate) fn directions(
        &self,
        width: Width,
        facet: &Facet,
        normal: Vec3,
        at: &TouchInObject,
        touch: &Observation,
    ) -> f32 {
        let facing = match touch.says {
            Says::Position => 1.0,
            _ => self.normal_ratio(facet, normal, at.normal, width.normal_variance),
        };
        facing * self.stretch(facet, at.direction, touch)
    }

    /// Density of a touch's stretch about a patch, with its direction in the object frame: D of
    /// equation R4.
    #[inline]
    pub(crate) fn stretch(&self, facet: &Facet, direction: Vec3, touch: &Observation) -> f32 {
        let concentration = self.direction * facet.elongation() * touch.elongation;
        let cosine = direction.dot(facet.direction);
        stretch_ratio(concentration, cosine, touch.steadiness.stretch_outliers)
    }

    /// Ratio of the density of an exact normal to a uniform distribution, by the determinant of
    /// its covariance (rad⁴); outliers do not count.
    pub(crate) fn normal_peak(&self, determinant: f32) -> f32 {
        (1.0 - self.normal_outliers) * 2.0 / determinant.sqrt()
    }

    /// Ratio of the density of a touch's normal (`felt`) about the `expected` one of a facet to
    /// a uniform distribution of normals. `variance` is that of touch and placement, added to
    /// the facet's.
    ///
    /// Equation R5 of docs/recogniser.md; [`reference`](super::reference::normal_ratio) mirrors it.
    #[inline]
    fn normal_ratio(&self, facet: &Facet, expected: Vec3, felt: Vec3, variance: f32) -> f32 {
        let cosine = expected.dot(felt);
        let mut ratio = self.normal_outliers * FACING * (1.0 + cosine) * (1.0 + cosine);
        if cosine > 0.0 {
            let turned = felt - expected;
            let across = facet.normal.cross(facet.direction);
            let turned = Vec2::new(turned.dot(facet.direction), turned.dot(across));
            let variances = Vec2::from(facet.normal_variances()) + variance;
            let peak = 2.0 / (variances.x * variances.y).sqrt();
            let misfit = (turned * turned / variances).element_sum();
            ratio += (1.0 - self.normal_outliers) * peak * exp(-0.5 * misfit);
        }
        ratio
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::observe::touch::Touch;
    use crate::test_support::{map_of, places, seen, single, some_pose};
    use palpate_core::pose::Pose;

    fn turned(pose: &Pose) -> InversePose {
        let (rotation, translation) = single(pose);
        InversePose::new(rotation, translation)
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
    fn a_wrong_normal_costs_less_than_a_touch_that_fits_nowhere() {
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
    fn a_normal_turned_about_a_ridge_costs_less_than_along_it() {
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
        let mut observation = seen(&place, &pose);
        assert!((kernel.score(&map, &turned(&pose), &observation) - 0.01f32.ln()).abs() < 1e-5);
        assert!((kernel.floor_of(&observation) - 0.01f32.ln()).abs() < 1e-6);
        observation.weight = 0.25;
        let quarter = 0.25 * 0.01f32.ln();
        assert!((kernel.score(&map, &turned(&pose), &observation) - quarter).abs() < 1e-5);
    }

    #[test]
    fn all_touches_score_as_one_by_one_unless_hopeless() {
        let kernel = Kernel::new(&SurfaceOptions::default());
        let map = map_of(&places(500, 0));
        let (truth, wrong) = (some_pose(0), some_pose(1));
        let touches: Vec<Observation> = places(6, 1).iter().map(|p| seen(p, &truth)).collect();
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
        let touches: Vec<Observation> =
            places(3, 1).iter().map(|p| seen(p, &some_pose(0))).collect();
        let touches: Vec<&Observation> = touches.iter().collect();
        let alone = |pose| touches.iter().map(|touch| kernel.score(&map, pose, touch)).sum();
        let alone: Vec<f32> = poses.iter().map(alone).collect();
        assert_eq!(kernel.score_each(&map, &poses, &touches), alone);
        assert!(alone[0] > alone[1] + 10.0, "{alone:?}");
    }
}
