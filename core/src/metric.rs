//! Distances between two poses of a body: inertial distance, wrapped angles, symmetries.
//!
//! Source: section 3.4.2, equations 3.18–3.21, and Chirikjian and Zhou (1998), equation 4,
//! with the formulas settled in `docs/equations.md`. Bodies have uniform density; their frame
//! is the object's. Not here: distances that are independent of the body (`pose`).

use std::f64::consts::{PI, TAU};

use glam::{DMat3, DQuat, DVec3};

use crate::pose::Pose;

/// Distribution of a body's mass, for the inertial distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inertia {
    /// The centre of mass, object frame, metres.
    pub center: DVec3,
    /// ∫ (r − centre)(r − centre)ᵀ dm / m: J over the mass, square metres.
    pub second_moment: DMat3,
}

/// Order of a body's rotational symmetry about an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SymmetryOrder {
    /// The body coincides with itself after every 1/n of a turn; 1 is a body without symmetry.
    Finite(u32),
    /// The body coincides with itself at every angle.
    Continuous,
}

/// The rotations that leave a body unchanged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Symmetry {
    /// Order of the symmetry.
    pub order: SymmetryOrder,
    /// Axis of the rotations, object frame, norm 1.
    pub axis: DVec3,
    /// A point of the axis, object frame, metres.
    pub through: DVec3,
}

impl Symmetry {
    /// A body without symmetry.
    pub const NONE: Self =
        Self { order: SymmetryOrder::Finite(1), axis: DVec3::Z, through: DVec3::ZERO };

    /// The turn by `angle` about the axis: object frame to object frame.
    fn turn(&self, angle: f64) -> Pose {
        let rotation = DQuat::from_axis_angle(self.axis, angle);
        Pose { rotation, translation: self.through - rotation * self.through }
    }
}

impl Inertia {
    /// Point masses (metres, any unit of mass); `None` without any mass.
    #[must_use]
    pub fn of_points(points: impl Iterator<Item = (DVec3, f64)> + Clone) -> Option<Self> {
        let mass: f64 = points.clone().map(|(_, mass)| mass).sum();
        if mass <= 0.0 {
            return None;
        }
        let center = points.clone().map(|(at, mass)| mass * at).sum::<DVec3>() / mass;
        let mut sum = DMat3::ZERO;
        for (at, mass) in points {
            sum += mass * outer(at - center);
        }
        Some(Self { center, second_moment: sum * mass.recip() })
    }

    /// d² = ‖Δt‖² at the centre of mass + tr((R₁ − R₂) J (R₁ − R₂)ᵀ)/m; the distance in
    /// metres. Under pure translation it is the length of the translation.
    #[must_use]
    pub fn distance(&self, a: &Pose, b: &Pose) -> f64 {
        self.squared(a, b).sqrt()
    }

    /// The least distance between `a` and `b` turned by a symmetry of the body, metres.
    #[must_use]
    pub fn distance_modulo(&self, a: &Pose, b: &Pose, symmetry: &Symmetry) -> f64 {
        let at = |angle: f64| self.squared(a, &(*b * symmetry.turn(angle)));
        let least = match symmetry.order {
            SymmetryOrder::Finite(n) => {
                let n = n.max(1);
                (0..n).map(|k| at(TAU * f64::from(k) / f64::from(n))).fold(f64::INFINITY, f64::min)
            }
            SymmetryOrder::Continuous => {
                // The square is linear in the turn's matrix: mean − amplitude · cos(angle − best).
                let third = TAU / 3.0;
                let [p, q, r] = [at(0.0), at(third), at(2.0 * third)];
                let mean = (p + q + r) / 3.0;
                let (cosine, sine) = (p - mean, (q - r) / 3.0_f64.sqrt());
                mean - cosine.hypot(sine)
            }
        };
        least.max(0.0).sqrt()
    }

    fn squared(&self, a: &Pose, b: &Pose) -> f64 {
        let moved = (*a * self.center).distance_squared(*b * self.center);
        let turned = DMat3::from_quat(a.rotation) - DMat3::from_quat(b.rotation);
        let product = turned * self.second_moment * turned.transpose();
        moved + product.x_axis.x + product.y_axis.y + product.z_axis.z
    }
}

/// v vᵀ.
#[must_use]
pub fn outer(v: DVec3) -> DMat3 {
    DMat3::from_cols(v * v.x, v * v.y, v * v.z)
}

/// An angle brought into −π ..= π, radians.
#[must_use]
pub fn wrapped(angle: f64) -> f64 {
    let turned = angle.rem_euclid(TAU);
    if turned > PI { turned - TAU } else { turned }
}

/// The smallest angle between two orientations of a body in the plane, modulo its symmetry:
/// equations 3.18–3.21 as corrected, radians within 0 ..= π.
#[must_use]
pub fn planar_angle_error(found: f64, truth: f64, order: SymmetryOrder) -> f64 {
    match order {
        SymmetryOrder::Continuous => 0.0,
        SymmetryOrder::Finite(n) => {
            let period = TAU / f64::from(n.max(1));
            let apart = (found - truth).rem_euclid(period);
            apart.min(period - apart)
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use proptest::prelude::*;

    use super::*;
    use crate::rng::{Purpose, Stream};

    /// A uniform ball of radius 40 mm: J/m = r²/5.
    const BALL: Inertia = Inertia {
        center: DVec3::ZERO,
        second_moment: DMat3::from_diagonal(DVec3::splat(0.04 * 0.04 / 5.0)),
    };

    fn random_pose(seed: u64) -> Pose {
        let mut stream = Stream::new(seed, Purpose::ObjectPose, 0);
        Pose::from_parts(stream.rotation(), 0.1 * stream.direction())
    }

    #[test]
    fn a_rod_turned_by_a_quarter_by_hand() {
        // Points at ±1 on x: J/m = diag(1, 0, 0). Turned onto y, R₁ − R₂ maps x to (1, −1, 0):
        // the trace is 2.
        let rod = Inertia::of_points([(DVec3::X, 2.0), (DVec3::NEG_X, 2.0)].into_iter()).unwrap();
        let turned = Pose { rotation: DQuat::from_rotation_z(FRAC_PI_2), ..Pose::IDENTITY };
        assert!((rod.distance(&Pose::IDENTITY, &turned) - 2.0_f64.sqrt()).abs() < 1e-12);
        // Rotation about its own axis does not move a rod.
        let spun = Pose { rotation: DQuat::from_rotation_x(1.0), ..Pose::IDENTITY };
        assert!(rod.distance(&Pose::IDENTITY, &spun) < 1e-12);
    }

    #[test]
    fn translation_is_measured_at_the_center_of_mass() {
        let off = Inertia { center: DVec3::X, ..BALL };
        let turned = Pose { rotation: DQuat::from_rotation_z(PI), ..Pose::IDENTITY };
        // The centre moves from 1 to −1: 4, and the ball turns in place: (8/5)·0.0016.
        let expected = (4.0_f64 + 1.6 * 0.0016).sqrt();
        assert!((off.distance(&Pose::IDENTITY, &turned) - expected).abs() < 1e-12);
    }

    #[test]
    fn distance_modulo_ignores_turns_of_the_symmetry() {
        let symmetry = |order| Symmetry { order, axis: DVec3::Z, through: DVec3::X };
        let half = symmetry(SymmetryOrder::Finite(2));
        let any = symmetry(SymmetryOrder::Continuous);
        let pose = random_pose(3);
        assert!(BALL.distance_modulo(&pose, &(pose * half.turn(PI)), &half) < 1e-7);
        assert!(BALL.distance_modulo(&pose, &(pose * half.turn(PI)), &Symmetry::NONE) > 0.01);
        assert!(BALL.distance_modulo(&pose, &(pose * any.turn(1.234)), &any) < 1e-7);
    }

    #[test]
    fn planar_angle_errors_are_at_most_half_a_period() {
        let error = |found, order| planar_angle_error(found, 0.1, order);
        assert!((error(TAU - 0.1, SymmetryOrder::Finite(1)) - 0.2).abs() < 1e-12);
        assert!((error(PI + 0.2, SymmetryOrder::Finite(2)) - 0.1).abs() < 1e-12);
        assert!(error(2.0, SymmetryOrder::Continuous).abs() < 1e-12);
        assert!((wrapped(1.5 * PI) + FRAC_PI_2).abs() < 1e-12);
    }

    proptest! {
        #[test]
        fn a_balls_distance_matches_the_closed_form(a in 0u64..200, b in 0u64..200) {
            let (a, b) = (random_pose(a), random_pose(b));
            // Chirikjian and Zhou (1998), equation 4: d² = ‖Δt‖² + (4r²/5)(1 − cos φ).
            let turned = 0.8 * 0.04 * 0.04 * (1.0 - a.angle_to(&b).cos());
            let expected = (a.translation.distance_squared(b.translation) + turned).sqrt();
            prop_assert!((BALL.distance(&a, &b) - expected).abs() < 1e-8);
        }

        #[test]
        fn a_continuous_symmetry_is_the_limit_of_many_folds(a in 0u64..50, b in 50u64..100) {
            let body = Inertia {
                center: DVec3::new(0.01, -0.02, 0.0),
                second_moment: DMat3::from_diagonal(DVec3::new(1e-4, 2e-4, 5e-4)),
            };
            let symmetry =
                |order| Symmetry { order, axis: DVec3::Z, through: DVec3::new(0.0, 0.03, 0.0) };
            let at = |order| {
                body.distance_modulo(&random_pose(a), &random_pose(b), &symmetry(order))
            };
            let (every, many) = (at(SymmetryOrder::Continuous), at(SymmetryOrder::Finite(3_600)));
            prop_assert!(every <= many + 1e-9 && many - every < 1e-4, "{} {}", every, many);
        }
    }
}
