//! The density of an observed pair under a stored pair of patches.
//!
//! The uncertainty of a normal is anisotropic. Along a ridge or a shaft the sensor is aligned
//! with the surface; about it, it may take almost any orientation (`model::bend`). The deviation
//! of each angle of a pair is therefore the scatter of its two normals in the direction that
//! changes the angle, and a pair that fits only because its angles are uncertain weighs less
//! than one that fits closely.

use std::f64::consts::TAU;

use glam::{Vec2, Vec3};
use palpate_core::exponential::exp;

use crate::model::facet::Facet;
use crate::model::pair_geometry::PairGeometry;
use crate::observe::observation::Observation;
use crate::observe::stretch::stretch_ratio;
use crate::options::{PairTolerance, SurfaceOptions};

/// Share of the variance of normals between an observed pair and the nearest stored ones: many
/// stored pairs are near, and they scatter as well.
const SCATTER_SHARE: f32 = 0.625;

/// Share of each of two parts in the pair's own deviation of a cosine: the reading's, and that
/// of the stored cosines.
const OWN_SHARE: f32 = 0.5;

/// Squared deviations beyond which the density is zero.
const MISFIT_MAX: f32 = 16.0;

/// Cap on the variance of the angle about the axis, rad²: practically undetermined.
const OPEN_TURN: f32 = 3.0;

/// Squared sine below which a normal has no direction about the axis.
const ALONG_AXIS: f32 = 1e-3;

/// Usual product of the deviations of a pair's three angles, rad³, at which an exact fit weighs 1.
const USUAL_DEVIATIONS: f32 = 1e-3;

/// Cap on the deviation (rad) by which unsteady sensors widen the tolerance of angles: a search
/// through all pairs would cost more than it gains.
const UNSTEADY_MAX: f32 = 0.3;

/// Deviations of loose placement that widen the tolerance of a pair.
const LOOSE_DEVIATIONS: f32 = 2.0;

/// Caps on the deviations between two loosely placed touches (m, rad) by which the tolerance of
/// their pair is widened, for the same reason: looser touches are paired as if they were this loose.
const LOOSE_POSITION_MAX: f32 = 0.015;
const LOOSE_ANGLE_MAX: f32 = 0.15;

/// Density of the observed pair `query` of `touches` under the `stored` pair of `facets`: its
/// distance, the angles of both normals with the axis and the turn about it, relative to an exact
/// fit at usual deviations. `None` beyond the tolerance.
///
/// Equation R9 of docs/recogniser.md.
#[inline]
pub(crate) fn pair_density(
    touches: [&Observation; 2],
    query: &PairGeometry,
    stored: &PairGeometry,
    facets: [&Facet; 2],
    options: &SurfaceOptions,
) -> Option<f32> {
    let distance = (query.distance - stored.distance).abs();
    let difference = |end: usize| query.cosines[end] - stored.cosines[end];
    let (first, second) = (difference(0), difference(1));
    let tolerance = options.pairs;
    if distance > tolerance.distance || first.abs().max(second.abs()) > tolerance.cosine {
        return None;
    }
    let axis = (facets[1].position - facets[0].position) / stored.distance;
    let deviation = options.pair_deviation;
    // Half of it is the reading's, half that of the stored cosines.
    let least = (OWN_SHARE * deviation.cosine).powi(2);
    let scatter = |end: usize| {
        let (facet, [along, across]) = (facets[end], facets[end].normal_variances());
        let own = least + touches[end].steadiness.normal_variance;
        let (along, across) = (SCATTER_SHARE * along + own, SCATTER_SHARE * across + own);
        let side = facet.normal.cross(facet.direction);
        // Variance with which the normal turns towards a direction.
        let towards =
            |v: Vec3| along * facet.direction.dot(v).powi(2) + across * side.dot(v).powi(2);
        let about = axis.cross(facet.normal);
        let sine = about.length_squared().max(ALONG_AXIS);
        (towards(axis) + least, towards(about) / (sine * sine))
    };
    let ((variance_first, turn_first), (variance_second, turn_second)) = (scatter(0), scatter(1));
    // Cosine and sine of the angle between the normals about the axis, times both sines.
    let turned = |pair: &PairGeometry| {
        let [first, second, between] = pair.cosines;
        Vec2::new(between - first * second, pair.chirality)
    };
    let (seen, known) = (turned(query), turned(stored));
    let sines = seen.length().max(ALONG_AXIS);
    let turn = seen.perp_dot(known).atan2(seen.dot(known));
    let variance_turn = turn_first + turn_second + deviation.cosine.powi(2) / sines;
    let variance_turn = variance_turn.min(OPEN_TURN);
    let misfit = (distance / deviation.distance).powi(2)
        + first * first / variance_first
        + second * second / variance_second
        + turn * turn / variance_turn;
    if misfit > MISFIT_MAX {
        return None;
    }
    let deviations = (variance_first * variance_second * variance_turn).sqrt();
    Some(USUAL_DEVIATIONS / deviations * exp(-0.5 * misfit))
}

/// The integral of [`pair_density`] over the distance (m), both cosines and the turn (rad) of the
/// observed pair.
pub(crate) fn mass(touches: [&Observation; 2], options: &SurfaceOptions) -> f64 {
    let deviation = widened(options, touches).pair_deviation.distance;
    f64::from(USUAL_DEVIATIONS) * TAU.powi(2) * f64::from(deviation)
}

/// Ratio of the density of both contacts' stretches, seen from the axis between them, to any
/// direction: two factors of equation R6.
pub(crate) fn pair_stretch_ratio(
    touches: [&Observation; 2],
    facets: [&Facet; 2],
    options: &SurfaceOptions,
) -> f32 {
    let seen_axis = touches[1].position - touches[0].position;
    let axis = facets[1].position - facets[0].position;
    let mut likelier = 1.0;
    for (touch, facet) in touches.into_iter().zip(facets) {
        let stretch = options.scale.direction * touch.elongation * facet.elongation();
        let along = |normal: Vec3, direction: Vec3, axis: Vec3| {
            Vec2::new(direction.dot(axis), direction.dot(normal.cross(axis))).normalize_or_zero()
        };
        let seen = along(touch.normal, touch.direction, seen_axis);
        let known = along(facet.normal, facet.direction, axis);
        let cosine = seen.dot(known);
        likelier *= stretch_ratio(stretch, cosine, touch.steadiness.stretch_outliers);
    }
    likelier
}

/// The options for two touches: wider by the looseness of their bases and the unsteadiness of
/// their normals.
pub(crate) fn widened(options: &SurfaceOptions, touches: [&Observation; 2]) -> SurfaceOptions {
    let mut options = *options;
    let (position, angle) = touches[0].looseness_to(touches[1]);
    let wider = |known: PairTolerance| PairTolerance {
        distance: known.distance.hypot(LOOSE_DEVIATIONS * position.sqrt().min(LOOSE_POSITION_MAX)),
        cosine: known.cosine.hypot(LOOSE_DEVIATIONS * angle.sqrt().min(LOOSE_ANGLE_MAX)),
    };
    if position > 0.0 || angle > 0.0 {
        options.pairs = wider(options.pairs);
        options.pair_deviation = wider(options.pair_deviation);
    }
    options.pairs.cosine = options.pairs.cosine.hypot(LOOSE_DEVIATIONS * unsteady(touches).sqrt());
    options
}

/// Variance (rad²) of the angles of a pair whose sensors may not have been aligned with the
/// surface.
fn unsteady(touches: [&Observation; 2]) -> f32 {
    let variance: f32 = touches.iter().map(|touch| touch.steadiness.normal_variance).sum();
    variance.min(UNSTEADY_MAX * UNSTEADY_MAX)
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec3};

    use super::*;
    use crate::model::SurfaceMap;
    use crate::model::bend::Bend;
    use crate::observe::touch::Touch;
    use crate::test_support::{map_of, places, seen};
    use palpate_core::pose::Pose;
    use palpate_core::reading::{Base, Looseness};

    /// Two touches 20 mm apart along x whose normals are at right angles to the axis and to each
    /// other, and whose contacts are stretched in these directions.
    fn map(directions: [DVec3; 2]) -> SurfaceMap {
        let normals = [DVec3::Z, DVec3::Y];
        let touch = |end: usize| Touch {
            position: DVec3::X * if end == 0 { -0.010 } else { 0.010 },
            normal: normals[end],
            direction: directions[end],
            ..places(1, 0).remove(0)
        };
        map_of(&[touch(0), touch(1)])
    }

    /// The fit of the map's pair, its first normal turned by `turn`, with scattering by
    /// `variances` along and across both stretches.
    fn fit_of(map: &SurfaceMap, turn: DQuat, variances: [f32; 2]) -> Option<f32> {
        fit_of_pressed(map, turn, variances, 1.0)
    }

    /// The same with this evenness of both touches.
    fn fit_of_pressed(
        map: &SurfaceMap,
        turn: DQuat,
        variances: [f32; 2],
        evenness: f64,
    ) -> Option<f32> {
        let patches = [&map.patches()[0], &map.patches()[1]];
        let ends = patches.map(|patch| (patch.position, patch.normal));
        let stored = PairGeometry::new(ends[0], ends[1]).unwrap();
        let turned = (turn * patches[0].normal.as_dvec3()).as_vec3();
        let query = PairGeometry::new((ends[0].0, turned), ends[1]).unwrap();
        let bend = Bend { form: [0.0; 3], normal_variances: variances };
        let facets = patches.map(|patch| Facet::new(patch, &bend));
        let touch = seen(&Touch { evenness, ..places(1, 0).remove(0) }, &Pose::IDENTITY);
        let touches = [&touch, &touch];
        let options = widened(&SurfaceOptions::default(), touches);
        pair_density(touches, &query, &stored, facets.each_ref(), &options)
    }

    #[test]
    fn a_pair_is_looked_up_as_loose_by_15_mm_at_most() {
        let touch = seen(&places(1, 0).remove(0), &Pose::IDENTITY);
        let tolerance = |position: f64, angle: f64| {
            let looseness = Looseness { position, angle };
            let on = |robot| touch.clone().with_base(Some(Base { robot, looseness }));
            let PairTolerance { distance, cosine } =
                widened(&SurfaceOptions::default(), [&on(1), &on(2)]).pairs;
            [distance, cosine]
        };
        // Both bases together are looser by √2.
        let [distance, cosine] = tolerance(0.005, 0.05);
        let most = tolerance(0.1, 1.0);
        assert!(distance < most[0] && cosine < most[1]);
        assert_eq!(tolerance(0.011, 0.11).map(f32::to_bits), most.map(f32::to_bits));
        let known = SurfaceOptions::default().pairs;
        assert!((most[0] - known.distance.hypot(0.030)).abs() < 1e-6);
        assert!((most[1] - known.cosine.hypot(0.30)).abs() < 1e-6);
    }

    #[test]
    fn an_exact_pair_weighs_one_over_its_deviations() {
        let map = map([DVec3::X, DVec3::X]);
        // Angles with the axis turn along the stretch: 0.625 · 0.01 + 2 · 0.05² = 0.01125 each;
        // the turn about it across: 2 (0.625 · 0.04 + 0.05²) + 0.1² = 0.065.
        let expected = 1e-3 / (0.01125f32 * 0.01125 * 0.065).sqrt();
        let found = fit_of(&map, DQuat::IDENTITY, [0.01, 0.04]).unwrap();
        assert!((found / expected - 1.0).abs() < 1e-3, "{found} {expected}");
    }

    #[test]
    fn a_normal_may_turn_about_a_ridge_and_not_along_it() {
        // Ridges along the axis: rotation about it costs little, tilt along it much.
        let ridges = map([DVec3::X, DVec3::X]);
        let variances = [0.002_5, 0.16];
        let exact = fit_of(&ridges, DQuat::IDENTITY, variances).unwrap();
        let about = fit_of(&ridges, DQuat::from_rotation_x(0.17), variances).unwrap();
        let along = fit_of(&ridges, DQuat::from_rotation_y(0.17), variances).unwrap();
        assert!(about > 0.9 * exact, "{about} {exact}");
        // 0.17² / (0.625 · 0.0025 + 0.005): e^−2.2.
        assert!((0.05..0.2).contains(&(along / exact)), "{along} {exact}");
        // Ridges across the axis: the reverse.
        let ridges = map([DVec3::Y, DVec3::Z]);
        let about = fit_of(&ridges, DQuat::from_rotation_x(0.17), variances).unwrap();
        let along = fit_of(&ridges, DQuat::from_rotation_y(0.17), variances).unwrap();
        assert!(along > about, "{along} {about}");
    }

    #[test]
    fn normals_of_an_uneven_press_may_be_turned_any_way() {
        let map = map([DVec3::Y, DVec3::Z]);
        let leaning = DQuat::from_rotation_y(0.3);
        let pressed = |turn, evenness| fit_of_pressed(&map, turn, [0.01, 0.01], evenness);
        assert!(pressed(leaning, 1.0).is_none());
        // 0.2 of evenness missing: 0.37 rad; 0.3² / 0.14 of a squared misfit.
        let (exact, found) = (pressed(DQuat::IDENTITY, 0.33), pressed(leaning, 0.33));
        let ratio = found.unwrap() / exact.unwrap();
        assert!((0.6..0.95).contains(&ratio), "{ratio}");
        // An uncertain fit weighs less than a close one.
        assert!(exact < pressed(DQuat::IDENTITY, 1.0));
    }

    #[test]
    fn beyond_the_tolerance_there_is_no_fit() {
        let map = map([DVec3::X, DVec3::X]);
        assert!(fit_of(&map, DQuat::from_rotation_y(0.25), [0.25, 0.25]).is_none());
        // A mirror image differs by half a turn about the axis.
        let turned = fit_of(&map, DQuat::from_rotation_x(3.0), [0.002_5, 0.002_5]);
        assert!(turned.is_none(), "{turned:?}");
    }
}
