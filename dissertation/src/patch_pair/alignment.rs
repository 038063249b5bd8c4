//! Poses that align a stored pair of patches with an observed one.
//!
//! Two matched points fix everything but the rotation about the line through them; the
//! normals give its distribution. Source: sections 5.4.1 and 5.4.3, equations 5.26–5.35, with
//! the closed forms of `docs/equations.md`: shortest-arc frames with an explicit half-turn
//! branch, the angle from an atan2, and a wrapped normal that is uniform above π/2.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DQuat, DVec3};

use palpate_core::pose::Pose;

/// One end of a pair: a point, its outward normal, and the normal's confidence (0–1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairEnd {
    /// Position, metres.
    pub position: DVec3,
    /// Outward normal, norm 1.
    pub normal: DVec3,
    /// normConf of Algorithm 2.
    pub normal_confidence: f64,
}

/// The line through a pair's points and the cosines of both normals with it: cheap to
/// compute, and enough to reject most matches.
#[derive(Clone, Copy, Debug)]
pub struct PairAxis {
    axis: DVec3,
    along: [f64; 2],
}

/// The frame of a pair of patches, with x along the pair's axis.
#[derive(Clone, Copy, Debug)]
pub struct PairFrame {
    axes: [DVec3; 3],
    from_pair: DQuat,
    middle: DVec3,
    normals: [Projected; 2],
}

/// The component of a normal across a pair's axis, as a complex number.
#[derive(Clone, Copy, Debug)]
struct Projected {
    across: (f64, f64),
    confidence: f64,
}

/// Distribution of a stored pair's rotation about the observed axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisAngle {
    /// ÂA, rad, between the two pairs' frames.
    pub mean: f64,
    /// Standard deviation, rad; above π/2 the distribution is uniform.
    pub spread: f64,
}

impl PairAxis {
    /// The axis from `a` to `b`, or `None` when the points coincide.
    #[must_use]
    pub fn new(a: &PairEnd, b: &PairEnd) -> Option<Self> {
        let between = b.position - a.position;
        let length = between.length();
        if length < 1e-9 {
            return None;
        }
        let axis = between / length;
        Some(Self { axis, along: [a.normal.dot(axis), b.normal.dot(axis)] })
    }

    /// Whether the normals make the same angles with the axis in both pairs, within
    /// `tolerance` on the cosine.
    #[must_use]
    pub fn normals_agree(&self, stored: &Self, tolerance: f64) -> bool {
        let differs = |end: usize| (self.along[end] - stored.along[end]).abs();
        differs(0) <= tolerance && differs(1) <= tolerance
    }
}

impl PairFrame {
    /// The frame of the pair `a`, `b` whose axis is given.
    #[must_use]
    pub fn new(axis: &PairAxis, a: &PairEnd, b: &PairEnd) -> Self {
        let (axes, from_pair) = shortest_arc_from_x(axis.axis);
        let project = |end: &PairEnd| Projected {
            across: (end.normal.dot(axes[1]), end.normal.dot(axes[2])),
            confidence: end.normal_confidence,
        };
        let middle = 0.5 * (a.position + b.position);
        Self { axes, from_pair, middle, normals: [project(a), project(b)] }
    }

    /// The distribution of rotations that align the stored pair's normals with this observed
    /// pair's. Equations 5.26–5.35: the angle of Σ z_obs · conj(z_stored), spread
    /// `sigma_init` (rad) over the alignment confidence.
    #[must_use]
    pub fn axis_angle(&self, stored: &Self, sigma_init: f64) -> AxisAngle {
        let (mut cos, mut sin, mut confidence) = (0.0, 0.0, 0.0);
        for (seen, known) in self.normals.iter().zip(&stored.normals) {
            let ((a, b), (c, d)) = (seen.across, known.across);
            cos += a * c + b * d;
            sin += b * c - a * d;
            let lengths = (a * a + b * b).sqrt() * (c * c + d * d).sqrt();
            confidence += 0.5 * lengths * seen.confidence * known.confidence;
        }
        let spread = if confidence > 0.0 { sigma_init / confidence } else { f64::INFINITY };
        AxisAngle { mean: sin.atan2(cos), spread }
    }

    /// The poses `observed_from_stored` at rotations of the stored pair about the axis.
    #[must_use]
    pub fn turns<'a>(&'a self, stored: &Self) -> Turns<'a> {
        let into_pair = stored.from_pair.conjugate();
        let middle_in_pair = into_pair * stored.middle;
        Turns {
            observed: self,
            without_turn: self.from_pair * into_pair,
            with_half_turn: self.from_pair * DQuat::from_xyzw(1.0, 0.0, 0.0, 0.0) * into_pair,
            middle_in_pair,
        }
    }
}

/// All poses of a stored pair on an observed one, by angle.
pub struct Turns<'a> {
    observed: &'a PairFrame,
    without_turn: DQuat,
    with_half_turn: DQuat,
    middle_in_pair: DVec3,
}

impl Turns<'_> {
    /// The pose at a rotation by `angle` rad: midpoints matched, axes aligned.
    #[must_use]
    pub fn pose(&self, angle: f64) -> Pose {
        let (sin_half, cos_half) = (0.5 * angle).sin_cos();
        let (sin, cos) = (2.0 * sin_half * cos_half, cos_half * cos_half - sin_half * sin_half);
        let [along, across_y, across_z] = self.observed.axes;
        let m = self.middle_in_pair;
        let turned =
            along * m.x + across_y * (m.y * cos - m.z * sin) + across_z * (m.y * sin + m.z * cos);
        Pose {
            rotation: self.without_turn * cos_half + self.with_half_turn * sin_half,
            translation: self.observed.middle - turned,
        }
    }
}

impl AxisAngle {
    /// Calls `visit(angle, weight)` for samples of the distribution at steps of about `step`
    /// rad; the weights sum to 1. A wrapped normal out to `reach` deviations, or the whole
    /// circle uniformly when the spread exceeds π/2.
    pub fn for_each_sample(&self, step: f64, reach: f64, mut visit: impl FnMut(f64, f64)) {
        if self.spread > FRAC_PI_2 {
            let n = (TAU / step).ceil();
            for k in 0..n as usize {
                visit(self.mean + k as f64 * TAU / n, n.recip());
            }
            return;
        }
        let reach = (reach * self.spread / step).round().min(PI / step) as i32;
        let density = |k: i32| (-0.5 * (f64::from(k) * step / self.spread).powi(2)).exp();
        let total = 1.0 + 2.0 * (1..=reach).map(density).sum::<f64>();
        for k in -reach..=reach {
            let weight = if k == 0 { 1.0 } else { density(k) };
            visit(self.mean + f64::from(k) * step, weight / total);
        }
    }
}

/// The shortest rotation from +x to `axis`: its axes, and its quaternion.
fn shortest_arc_from_x(axis: DVec3) -> ([DVec3; 3], DQuat) {
    let DVec3 { x, y, z } = axis;
    if x < -1.0 + 1e-9 {
        // Half a turn: about z, as good as any axis across x.
        return ([axis, DVec3::NEG_Y, DVec3::Z], DQuat::from_xyzw(0.0, 0.0, 1.0, 0.0));
    }
    let k = (1.0 + x).recip();
    let across_y = DVec3::new(-y, 1.0 - y * y * k, -y * z * k);
    let across_z = DVec3::new(-z, -y * z * k, 1.0 - z * z * k);
    let quaternion = DQuat::from_xyzw(0.0, -z, y, 1.0 + x).normalize();
    ([axis, across_y, across_z], quaternion)
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix2;
    use proptest::prelude::*;

    use super::*;
    use palpate_core::rng::{Purpose, Stream};

    fn random_end(stream: &mut Stream) -> PairEnd {
        let position = 0.04 * stream.direction();
        PairEnd { position, normal: stream.direction(), normal_confidence: 1.0 }
    }

    fn frame(a: &PairEnd, b: &PairEnd) -> PairFrame {
        PairFrame::new(&PairAxis::new(a, b).unwrap(), a, b)
    }

    fn moved(end: &PairEnd, pose: Pose) -> PairEnd {
        PairEnd { position: pose * end.position, normal: pose.turn(end.normal), ..*end }
    }

    proptest! {
        #[test]
        fn an_exact_match_recovers_the_pose(seed in 0u64..500) {
            let mut stream = Stream::new(seed, Purpose::ObjectPose, 0);
            let (a, b) = (random_end(&mut stream), random_end(&mut stream));
            let session_from_object = Pose::from_parts(stream.rotation(), 0.2 * stream.direction());
            let (a_seen, b_seen) = (moved(&a, session_from_object), moved(&b, session_from_object));
            let (seen, stored) = (frame(&a_seen, &b_seen), frame(&a, &b));
            let axes = (PairAxis::new(&a_seen, &b_seen).unwrap(), PairAxis::new(&a, &b).unwrap());
            let angle = seen.axis_angle(&stored, 0.1);
            let pose = seen.turns(&stored).pose(angle.mean);
            prop_assert!(axes.0.normals_agree(&axes.1, 1e-9));
            prop_assert!(pose.distance_to(&session_from_object) < 1e-9);
            prop_assert!(pose.angle_to(&session_from_object) < 1e-6);
        }

        #[test]
        fn the_closed_form_equals_the_svd_of_the_dissertation(seed in 0u64..500) {
            // Equations 5.30–5.32 in the plane across the axis, with the determinant corrected.
            let mut stream = Stream::new(seed, Purpose::ObjectPose, 1);
            let mut random_pair = || {
                frame(&random_end(&mut stream), &random_end(&mut stream))
            };
            let (seen, stored) = (random_pair(), random_pair());
            let mut h = Matrix2::zeros();
            for (n, m) in seen.normals.iter().zip(&stored.normals) {
                let column = |p: (f64, f64)| nalgebra::Vector2::new(p.0, p.1);
                h += column(m.across) * column(n.across).transpose();
            }
            let svd = h.svd(true, true);
            let (u, v) = (svd.u.unwrap(), svd.v_t.unwrap().transpose());
            let sign = (v * u.transpose()).determinant().signum();
            let rotation = v * Matrix2::new(1.0, 0.0, 0.0, sign) * u.transpose();
            let expected = rotation[(1, 0)].atan2(rotation[(0, 0)]);
            let difference = (seen.axis_angle(&stored, 0.1).mean - expected).rem_euclid(TAU);
            prop_assert!(difference.min(TAU - difference) < 1e-6);
        }
    }

    #[test]
    fn a_pair_along_minus_x_has_a_valid_frame() {
        let end = |x: f64| PairEnd {
            position: DVec3::new(x, 0.0, 0.0),
            normal: DVec3::Y,
            normal_confidence: 1.0,
        };
        let pair = frame(&end(1.0), &end(0.0));
        assert!((pair.from_pair * DVec3::X).distance(DVec3::NEG_X) < 1e-12);
        assert!((pair.from_pair * DVec3::Y).distance(pair.axes[1]) < 1e-12);
    }

    #[test]
    fn confident_normals_across_the_axis_give_sigma_init() {
        // Both normals across the axis, confidence 1: alignConf = (1 + 1) / 2 = 1.
        let end = |x: f64| PairEnd {
            position: DVec3::new(x, 0.0, 0.0),
            normal: DVec3::Z,
            normal_confidence: 1.0,
        };
        let pair = frame(&end(0.0), &end(0.05));
        let angle = pair.axis_angle(&pair, 0.1);
        assert!((angle.spread - 0.1).abs() < 1e-12 && angle.mean.abs() < 1e-12);
    }

    #[test]
    fn samples_sum_to_one_and_an_unknown_angle_covers_the_circle() {
        for spread in [0.01, 0.1, 0.5, 1.5, f64::INFINITY] {
            let angle = AxisAngle { mean: 0.3, spread };
            let (mut total, mut n) = (0.0, 0);
            angle.for_each_sample(0.25, 2.0, |_, weight| {
                total += weight;
                n += 1;
            });
            assert!((total - 1.0).abs() < 1e-9, "spread {spread}");
            assert_eq!(n == 26, spread > FRAC_PI_2, "spread {spread}: {n} samples");
        }
    }
}
