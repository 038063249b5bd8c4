//! Signed distances of simple bodies and their combinations, in millimetres.
//!
//! Negative inside. Combinations and stretched bodies give bounds rather than distances,
//! which is all that meshing needs near the surface. Formulas: Quilez, "Distance functions".

use glam::{DVec2, DVec3};

/// A ball around the origin.
pub(super) fn ball(at: DVec3, radius: f64) -> f64 {
    at.length() - radius
}

/// An ellipsoid around the origin with these half-axes.
pub(super) fn ellipsoid(at: DVec3, half: DVec3) -> f64 {
    let outward = (at / half).length();
    let slope = (at / (half * half)).length();
    if slope < 1e-12 { -half.min_element() } else { outward * (outward - 1.0) / slope }
}

/// A box around the origin with these half-sides, its edges rounded within them.
pub(super) fn cuboid(at: DVec3, half: DVec3, rounding: f64) -> f64 {
    let beyond = at.abs() - (half - rounding);
    beyond.max(DVec3::ZERO).length() + beyond.max_element().min(0.0) - rounding
}

/// A cylinder along z around the origin.
pub(super) fn cylinder(at: DVec3, radius: f64, half_height: f64, rounding: f64) -> f64 {
    let flat = DVec2::new(at.truncate().length() - radius, at.z.abs() - half_height) + rounding;
    flat.max(DVec2::ZERO).length() + flat.max_element().min(0.0) - rounding
}

/// A ring around z: the radius of its middle line and of its tube.
pub(super) fn torus(at: DVec3, radius: f64, tube: f64) -> f64 {
    DVec2::new(at.truncate().length() - radius, at.z).length() - tube
}

/// A straight limb that tapers from one radius to another.
pub(super) fn limb(
    at: DVec3,
    (from, from_radius): (DVec3, f64),
    (to, to_radius): (DVec3, f64),
) -> f64 {
    let way = to - from;
    let along = ((at - from).dot(way) / way.length_squared()).clamp(0.0, 1.0);
    at.distance(from + along * way) - (from_radius + along * (to_radius - from_radius))
}

/// A chain of limbs through points with their radii.
pub(super) fn chain(at: DVec3, joints: &[(DVec3, f64)]) -> f64 {
    joints.windows(2).map(|pair| limb(at, pair[0], pair[1])).fold(f64::INFINITY, f64::min)
}

/// The polygon's inside, in its plane.
pub(super) fn polygon(at: DVec2, corners: &[(f64, f64)]) -> f64 {
    let mut nearest = f64::INFINITY;
    let mut inside = false;
    for (idx, corner) in corners.iter().enumerate() {
        let a = DVec2::from(*corner);
        let b = DVec2::from(corners[(idx + corners.len() - 1) % corners.len()]);
        let (edge, offset) = (b - a, at - a);
        let along = (offset.dot(edge) / edge.length_squared()).clamp(0.0, 1.0);
        nearest = nearest.min((offset - along * edge).length_squared());
        let crosses = (a.y > at.y) != (b.y > at.y);
        if crosses && at.x < a.x + (at.y - a.y) / (b.y - a.y) * (b.x - a.x) {
            inside = !inside;
        }
    }
    if inside { -nearest.sqrt() } else { nearest.sqrt() }
}

/// A plane shape's distance extruded to `half` on both sides of its plane.
pub(super) fn extruded(in_plane: f64, off_plane: f64, half: f64, rounding: f64) -> f64 {
    let flat = DVec2::new(in_plane, off_plane.abs() - half) + rounding;
    flat.max(DVec2::ZERO).length() + flat.max_element().min(0.0) - rounding
}

/// The body of revolution around z of a profile of (radius, z).
pub(super) fn lathe(at: DVec3, profile: &[(f64, f64)]) -> f64 {
    polygon(DVec2::new(at.truncate().length(), at.z), profile)
}

/// A profile with every corner off the axis cut at a quarter of its sides (Chaikin 1974).
pub(super) fn smoothed(profile: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mix = |a: (f64, f64), b: (f64, f64)| (0.75 * a.0 + 0.25 * b.0, 0.75 * a.1 + 0.25 * b.1);
    let (first, last) = (profile[0], profile[profile.len() - 1]);
    let cut = profile.windows(2).flat_map(|pair| [mix(pair[0], pair[1]), mix(pair[1], pair[0])]);
    std::iter::once(first).chain(cut).chain(std::iter::once(last)).collect()
}

/// The union with a fillet of about `blend`.
pub(super) fn blend(a: f64, b: f64, blend: f64) -> f64 {
    let overlap = (blend - (a - b).abs()).max(0.0) / blend;
    a.min(b) - 0.25 * blend * overlap * overlap
}

/// `a` without `b`.
pub(super) fn without(a: f64, b: f64) -> f64 {
    a.max(-b)
}

/// Folds an angle into one of `n` equal sectors around z, so that a body repeats in each.
pub(super) fn repeated_around(at: DVec3, n: u32) -> DVec3 {
    let sector = std::f64::consts::TAU / f64::from(n);
    let angle = at.y.atan2(at.x);
    let within = angle - sector * (angle / sector).round();
    let radius = at.truncate().length();
    DVec3::new(radius * within.cos(), radius * within.sin(), at.z)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(found: f64, expected: f64) {
        assert!((found - expected).abs() < 1e-9, "{found}, expected {expected}");
    }

    #[test]
    fn distances_match_elementary_geometry() {
        check(ball(DVec3::new(3.0, 4.0, 0.0), 2.0), 3.0);
        check(cuboid(DVec3::new(4.0, 5.0, 0.0), DVec3::ONE, 0.0), 5.0);
        check(cuboid(DVec3::ZERO, DVec3::new(1.0, 2.0, 3.0), 0.5), -1.0);
        check(cylinder(DVec3::new(0.0, 5.0, 0.0), 2.0, 1.0, 0.0), 3.0);
        check(torus(DVec3::new(0.0, 0.0, 4.0), 3.0, 1.0), 4.0);
        check(limb(DVec3::new(5.0, 3.0, 0.0), (DVec3::ZERO, 1.0), (10.0 * DVec3::X, 2.0)), 1.5);
        let square = [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)];
        check(polygon(DVec2::new(1.0, 0.5), &square), -0.5);
        check(polygon(DVec2::new(5.0, 6.0), &square), 5.0);
        check(lathe(DVec3::new(0.0, 3.0, 1.0), &square), 1.0);
    }

    #[test]
    fn a_repeated_body_appears_in_every_sector() {
        let at = repeated_around(DVec3::new(0.0, 5.0, 1.0), 4);
        assert!(at.distance(DVec3::new(5.0, 0.0, 1.0)) < 1e-12);
    }
}
