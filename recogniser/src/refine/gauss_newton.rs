//! Gauss–Newton: continuous refinement of a pose on the map by its touches (equation R21).
//!
//! Robust least squares of each touch's distance from the surface between the patches near it,
//! of its normal and, with low weight, of its place along the surface; touches that fit nowhere
//! lose their weight (Geman and McClure, 1987). Nine unknowns: the pose, and the error of the
//! tool centre that all touches share (equation R21a). The covariance is the inverse of the
//! Hessian (equation R22).

use std::collections::BTreeMap;

use glam::{DVec3, Mat3, Quat, Vec3};
use nalgebra::{Matrix3, Matrix6, SMatrix, SVector, Vector3, Vector6};
use palpate_core::reading::Looseness;

use super::surface_point::surface_point;
use crate::model::SurfaceMap;
use crate::observe::observation::{Observation, Says};
use crate::observe::placement::Shift;
use crate::options::{RefinementScale, SurfaceOptions};
use crate::verify::density::Kernel;
use crate::verify::hypothesis::Hypothesis;
use crate::verify::tool_error;

/// Maximum number of passes; the next touch refines again.
const PASSES_MAX: usize = 3;

/// Change of a pose below which a pass is the last one: metres, rad.
const CONVERGED: (f32, f32) = (5e-5, 2.5e-3);

/// Deviation of the start of a pass: metres, rad.
const START_DEVIATION: (f64, f64) = (0.01, 0.35);

/// Prior deviation of a pose before any touch: metres, rad.
const PRIOR_DEVIATION: (f64, f64) = (0.02, 0.5);

/// Least deviation of a pose, by the map's own sampling: metres, rad.
const FLOOR_DEVIATION: (f64, f64) = (0.000_2, 0.01);

/// Residual in deviations at which a touch has lost three quarters of its weight.
const OUTLIER: f32 = 3.0;

/// Number of unknowns: translation, rotation, and error of the tool centre.
const UNKNOWNS: usize = 9;

type Hessian = SMatrix<f64, UNKNOWNS, UNKNOWNS>;
type Gradient = SVector<f64, UNKNOWNS>;

/// The normal equations of a pose and the tool's error.
struct System {
    hessian: Hessian,
    gradient: Gradient,
}

impl Default for System {
    fn default() -> Self {
        Self { hessian: Hessian::zeros(), gradient: Gradient::zeros() }
    }
}

impl System {
    /// Adds the touches of one robot, all shifted by its base. The base's own six unknowns are
    /// eliminated (Schur complement): moving a base equals moving the object the other way, so
    /// that with prior information Λ and the columns U of the pose, H loses U (H₆ + Λ)⁻¹ Uᵀ.
    fn add_loose(&mut self, system: &Self, looseness: &Looseness) {
        let prior = diagonal((looseness.position, looseness.angle), -2);
        let of_pose = system.hessian.fixed_view::<6, 6>(0, 0);
        let Some(factor) = (of_pose + prior).cholesky() else { return };
        let columns = system.hessian.fixed_columns::<6>(0);
        let gradient = factor.solve(&system.gradient.fixed_rows::<6>(0).into_owned());
        self.hessian += system.hessian - columns * factor.solve(&columns.transpose());
        self.gradient += system.gradient - columns * gradient;
    }

    /// Adds the prior of the tool's error.
    fn add_tool(&mut self, tool: Vec3, scale: &RefinementScale) {
        let information = tool_error::information(tool, scale);
        let mut hessian = self.hessian.fixed_view_mut::<3, 3>(6, 6);
        hessian += Matrix3::identity() * information;
        let mut gradient = self.gradient.fixed_rows_mut::<3>(6);
        gradient -= column(tool) * information;
    }
}

/// Refines the pose of a hypothesis; its score must then be recomputed.
pub(crate) fn refine(
    hypothesis: &mut Hypothesis,
    map: &SurfaceMap,
    touches: &[Observation],
    kernel: &Kernel,
    options: &SurfaceOptions,
) {
    let mut start = Hessian::zeros();
    start.fixed_view_mut::<6, 6>(0, 0).copy_from(&diagonal(START_DEVIATION, -2));
    for _pass in 0..PASSES_MAX {
        let system = linearise(hypothesis, map, touches, kernel, options);
        let Some(factor) = (system.hessian + start).cholesky() else {
            return;
        };
        let change = factor.solve(&system.gradient);
        let moved = Vec3::new(change[0] as f32, change[1] as f32, change[2] as f32);
        let turned = Vec3::new(change[3] as f32, change[4] as f32, change[5] as f32);
        let shifted = Vec3::new(change[6] as f32, change[7] as f32, change[8] as f32);
        hypothesis.rotation = (Quat::from_scaled_axis(turned) * hypothesis.rotation).normalize();
        hypothesis.translation += moved;
        hypothesis.tool += shifted;
        if moved.length().max(shifted.length()) < CONVERGED.0 && turned.length() < CONVERGED.1 {
            break;
        }
    }
}

/// Uncertainty of a refined hypothesis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Uncertainty {
    /// Covariance of the pose: x, y, z (m), then rotation about the session's axes (rad).
    pub(crate) pose: Matrix6<f64>,
    /// Standard deviations of the tool's error along the sensor's axes, metres.
    pub(crate) tool: DVec3,
}

/// The uncertainty of a hypothesis. Equation R22 of docs/recogniser.md.
pub(crate) fn uncertainty(
    hypothesis: &Hypothesis,
    map: &SurfaceMap,
    touches: &[Observation],
    kernel: &Kernel,
    options: &SurfaceOptions,
) -> Uncertainty {
    let mut informed = linearise(hypothesis, map, touches, kernel, options).hessian;
    let mut of_pose = informed.fixed_view_mut::<6, 6>(0, 0);
    of_pose += diagonal(PRIOR_DEVIATION, -2);
    let floor = diagonal(FLOOR_DEVIATION, 2);
    match informed.cholesky().map(|factor| factor.inverse()) {
        Some(found) => {
            let deviation = |axis: usize| found[(6 + axis, 6 + axis)].sqrt() + FLOOR_DEVIATION.0;
            let pose = found.fixed_view::<6, 6>(0, 0).into_owned() + floor;
            Uncertainty { pose, tool: DVec3::from_array([0, 1, 2].map(deviation)) }
        }
        None => Uncertainty {
            pose: diagonal(PRIOR_DEVIATION, 2) + floor,
            tool: DVec3::splat(options.refinement.tool.into()),
        },
    }
}

fn diagonal((position, rotation): (f64, f64), power: i32) -> Matrix6<f64> {
    let (p, r) = (position.powi(power), rotation.powi(power));
    Matrix6::from_diagonal(&Vector6::new(p, p, p, r, r, r))
}

/// The normal equations at a pose; x, y, z (m), then rotation (rad) about the session's axes
/// through the object's origin, then the tool's error (m) in the sensor frame.
fn linearise(
    hypothesis: &Hypothesis,
    map: &SurfaceMap,
    touches: &[Observation],
    kernel: &Kernel,
    options: &SurfaceOptions,
) -> System {
    let Systems { mut exact, loose, .. } = systems(hypothesis, map, touches, kernel, options);
    for (looseness, system) in &loose {
        exact.add_loose(system, looseness);
    }
    exact.add_tool(hypothesis.tool, &options.refinement);
    exact
}

/// What touches contribute to the normal equations, by what shifts them.
#[derive(Default)]
struct Systems {
    /// The touches at their stated places.
    exact: System,
    /// The touches of each base, and each touch before a motion of the object.
    loose: Vec<(Looseness, System)>,
    /// The place of each robot's base among the loose ones.
    bases: BTreeMap<u32, usize>,
}

impl Systems {
    /// The system to which a touch contributes.
    fn of(&mut self, shift: Shift) -> &mut System {
        let next = self.loose.len();
        let (place, looseness) = match shift {
            Shift::None => return &mut self.exact,
            Shift::Base(robot, looseness) => (*self.bases.entry(robot).or_insert(next), looseness),
            Shift::Motion(looseness) => (next, looseness),
        };
        if place == next {
            self.loose.push((looseness, System::default()));
        }
        &mut self.loose[place].1
    }
}

/// The contributions of touches to the normal equations at a pose.
fn systems(
    hypothesis: &Hypothesis,
    map: &SurfaceMap,
    touches: &[Observation],
    kernel: &Kernel,
    options: &SurfaceOptions,
) -> Systems {
    let mut systems = Systems::default();
    let pose = hypothesis.inverse_pose();
    let session_from_object = pose.object_from_session.transpose();
    let along = kernel.along(map);
    let across = options.refinement.across.powi(-2);
    for touch in touches {
        let Some(place) = surface_point(kernel, map, &pose, touch) else { continue };
        let (position, angle) = touch.placement.shifting();
        let [across, along] = [across, along].map(|inverse| wider(inverse, touch.placement.own()));
        let system = systems.of(touch.placement.shifted_by());
        let outward = session_from_object * place.normal;
        let off = session_from_object * place.offset;
        // The surface moves by m + ω × arm away from the touch, the touch by R δ away from the
        // surface; the target of both is `off`.
        let arm = touch.position_with(hypothesis.tool) - hypothesis.translation;
        let moves = moves(arm, touch.session_from_sensor);
        let expected = (across.recip() + position).recip();
        let trust = trust(off.dot(outward).powi(2) * expected);
        let n = column(outward);
        let information = (n * n.transpose() * f64::from(across - along)
            + Matrix3::identity() * f64::from(along))
            * f64::from(trust);
        let weighted = moves.transpose() * information;
        system.hessian += weighted * moves;
        system.gradient += weighted * column(off);
        if touch.says == Says::Position {
            continue;
        }
        let usual =
            options.refinement.normal_factor * (place.normal_deviation + options.scale.normal);
        let deviation = usual.hypot(touch.steadiness.normal_variance.sqrt());
        let wrong = deviation.powi(2) + angle;
        turn_normal(system, outward, touch.normal - outward, deviation, wrong);
    }
    systems
}

/// The inverse variance of a touch whose position has a variance of its `own`.
fn wider(inverse: f32, own: f32) -> f32 {
    if own > 0.0 { (inverse.recip() + own).recip() } else { inverse }
}

/// Adds the residual `bent` of the surface's normal, which a rotation ω changes by ω × outward.
/// Its robust weight follows from the variance `wrong`.
fn turn_normal(system: &mut System, outward: Vec3, bent: Vec3, deviation: f32, wrong: f32) {
    let information = deviation.powi(-2);
    let weight = f64::from(trust(bent.length_squared() / wrong) * information);
    let n = column(outward);
    let mut gradient = system.gradient.fixed_rows_mut::<3>(3);
    gradient += column(outward.cross(bent)) * weight;
    let mut hessian = system.hessian.fixed_view_mut::<3, 3>(3, 3);
    hessian += (Matrix3::identity() - n * n.transpose()) * weight;
}

/// ω: the robust weight of a residual; `square` is in squared deviations.
fn trust(square: f32) -> f32 {
    (1.0 + square / (OUTLIER * OUTLIER)).powi(-2)
}

/// Motion of the surface relative to a touch at `arm` from the object's origin, for each unknown.
fn moves(arm: Vec3, session_from_sensor: Mat3) -> SMatrix<f64, 3, UNKNOWNS> {
    let mut moves = SMatrix::<f64, 3, UNKNOWNS>::zeros();
    moves.fixed_view_mut::<3, 3>(0, 0).copy_from(&Matrix3::identity());
    // ω × arm = −[arm]ₓ ω.
    moves.fixed_view_mut::<3, 3>(0, 3).copy_from(&-column(arm).cross_matrix());
    let tool = Matrix3::from_fn(|row, axis| -f64::from(session_from_sensor.col(axis)[row]));
    moves.fixed_view_mut::<3, 3>(0, 6).copy_from(&tool);
    moves
}

fn column(v: Vec3) -> Vector3<f64> {
    Vector3::new(v.x.into(), v.y.into(), v.z.into())
}

#[cfg(test)]
mod dense_tests;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observe::touch::Touch;
    use crate::test_support::{error, map_of, places, seen, single, some_pose};
    use palpate_core::pose::Pose;

    fn refined(start: &Pose, map: &SurfaceMap, touches: &[Observation]) -> Hypothesis {
        let options = SurfaceOptions::default();
        let (rotation, translation) = single(start);
        let mut hypothesis = Hypothesis::new(rotation, translation, 0.0);
        refine(&mut hypothesis, map, touches, &Kernel::new(&options), &options);
        hypothesis
    }

    /// A pose 2 mm and 0.08 rad off.
    fn disturbed(truth: &Pose) -> Pose {
        let turn = glam::DQuat::from_scaled_axis(DVec3::new(0.05, -0.05, 0.037));
        Pose::from_parts(turn * truth.rotation, truth.translation + DVec3::splat(0.001_15))
    }

    #[test]
    fn a_disturbed_pose_is_found_again_to_a_tenth_of_a_millimetre() {
        let map = map_of(&places(4_000, 0));
        for index in 0..5 {
            let truth = some_pose(index);
            let touches: Vec<Observation> =
                places(50, 10 + index).iter().map(|place| seen(place, &truth)).collect();
            let found = refined(&disturbed(&truth), &map, &touches);
            let (moved, turned) = error(found.rotation, found.translation, &truth);
            assert!(moved < 1e-4 && turned < 0.02, "{index}: {moved} m, {turned} rad");
        }
    }

    /// Touches of places by a sensor whose axes turn from touch to touch, with its centre `tool`
    /// beside where the robot states it, sensor frame.
    fn beside(places: &[Touch], pose: &Pose, tool: DVec3) -> Vec<Observation> {
        let touch = |(index, place): (usize, &Touch)| {
            let turn = glam::DQuat::from_axis_angle(place.normal, 2.4 * index as f64);
            let turned = Touch { sensor_x: turn * place.sensor_x, ..place.clone() };
            let position = place.position - turned.sensor_axes().as_dmat3() * tool;
            seen(&Touch { position, ..turned }, pose)
        };
        places.iter().enumerate().map(touch).collect()
    }

    #[test]
    fn a_tool_centre_too_high_or_too_low_is_found() {
        // Beside its place a smooth surface looks the same, so only the height is certain.
        let (map, truth) = (map_of(&places(4_000, 0)), some_pose(1));
        for tool in [DVec3::new(0.0, 0.0, -0.001), DVec3::new(0.0, 0.0, 0.002)] {
            let touches = beside(&places(12, 11), &truth, tool);
            let found = refined(&truth, &map, &touches);
            let off = (f64::from(found.tool.z) - tool.z).abs();
            let (moved, _) = error(found.rotation, found.translation, &truth);
            assert!(off < 0.000_2 && moved < 0.000_2, "{tool}: {off} m, pose {moved} m");
            // Touches by another sensor say nothing about the first one's centre.
            let others: Vec<_> = touches.into_iter().map(Observation::with_own_tool).collect();
            assert!(refined(&truth, &map, &others).tool.length() < 1e-9);
        }
    }

    #[test]
    fn a_wild_touch_does_not_pull() {
        let map = map_of(&places(4_000, 0));
        let truth = some_pose(1);
        let mut touches: Vec<Observation> =
            places(25, 11).iter().map(|place| seen(place, &truth)).collect();
        let without = refined(&truth, &map, &touches);
        // 5 mm above the surface is still within reach of the map's look-up.
        let above = 0.005 * touches[0].normal;
        touches[0].position += above;
        let with = refined(&truth, &map, &touches);
        let apart = without.translation.distance(with.translation);
        assert!(apart < 5e-5, "{apart}");
    }

    #[test]
    fn the_normal_of_an_uneven_press_turns_the_pose_less() {
        let map = map_of(&places(4_000, 0));
        let truth = some_pose(1);
        let turned = |evenness: f64| {
            // All normals lean the same way, by a fifth of a radian.
            let lean = glam::DQuat::from_rotation_x(0.2);
            let leaning =
                |place: &Touch| Touch { normal: lean * place.normal, evenness, ..place.clone() };
            let places = places(4, 11);
            let touches: Vec<Observation> =
                places.iter().map(|place| seen(&leaning(place), &truth)).collect();
            let found = refined(&truth, &map, &touches);
            error(found.rotation, found.translation, &truth).1
        };
        assert!(turned(0.9) > 1.5 * turned(0.2), "{} {}", turned(0.9), turned(0.2));
    }

    #[test]
    fn more_touches_make_a_pose_surer_and_never_surer_than_the_map() {
        let map = map_of(&places(2_000, 0));
        let truth = some_pose(2);
        let touches: Vec<Observation> =
            places(25, 12).iter().map(|place| seen(place, &truth)).collect();
        let options = SurfaceOptions::default();
        let (rotation, translation) = single(&truth);
        let hypothesis = Hypothesis::new(rotation, translation, 0.0);
        let kernel = Kernel::new(&options);
        let of = |touches: &[Observation]| {
            uncertainty(&hypothesis, &map, touches, &kernel, &options).pose
        };
        // Without touches: (20 mm)² + (0.2 mm)² and 0.5² + 0.01² rad².
        let none = of(&[]);
        assert!((none[(0, 0)] - 4.0004e-4).abs() < 1e-9 && (none[(5, 5)] - 0.2501).abs() < 1e-9);
        let (few, many) = (of(&touches[..3]), of(&touches));
        for axis in 0..6 {
            assert!(many[(axis, axis)] < few[(axis, axis)], "{axis}");
            assert!(few[(axis, axis)] <= none[(axis, axis)] + 1e-12, "{axis}");
        }
        assert!((0..3).all(|axis| many[(axis, axis)] >= 0.000_2f64.powi(2)));
        assert!((many - many.transpose()).abs().max() < 1e-12 && many.cholesky().is_some());
    }
}
