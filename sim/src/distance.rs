//! Distances between segments and triangles, for collision checks.
//!
//! Metres throughout; distances are squared. Source: Ericson (2005), *Real-Time Collision
//! Detection*, sections 5.1.5 and 5.1.9.

use glam::DVec3;

/// The squared distance between the segments `a`–`b` and `c`–`d`.
pub(crate) fn segment_to_segment_squared(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> f64 {
    let (first, second, between) = (b - a, d - c, a - c);
    let (first_sq, second_sq) = (first.length_squared(), second.length_squared());
    let (along_first, along_second) = (first.dot(between), second.dot(between));
    let mixed = first.dot(second);
    let denominator = first_sq * second_sq - mixed * mixed;
    // Parallel segments: any point of the first will do, the clamps below settle the rest.
    let mut s = if denominator > 1e-12 * first_sq * second_sq {
        ((mixed * along_second - along_first * second_sq) / denominator).clamp(0.0, 1.0)
    } else {
        0.0
    };
    let ratio = |numerator: f64, squared: f64| {
        if squared > 0.0 { (numerator / squared).clamp(0.0, 1.0) } else { 0.0 }
    };
    let t = ratio(mixed * s + along_second, second_sq);
    s = ratio(mixed * t - along_first, first_sq);
    (a + s * first).distance_squared(c + t * second)
}

/// The squared distance between the segment `from`–`to` and a triangle.
pub(crate) fn segment_to_triangle_squared(from: DVec3, to: DVec3, corners: &[DVec3; 3]) -> f64 {
    if crosses(corners, from, to) {
        return 0.0;
    }
    let [a, b, c] = *corners;
    let to_edge = |c: DVec3, d: DVec3| segment_to_segment_squared(from, to, c, d);
    let edges = to_edge(a, b).min(to_edge(b, c)).min(to_edge(c, a));
    let ends = above_triangle_squared(from, corners).min(above_triangle_squared(to, corners));
    edges.min(ends)
}

/// Whether a segment meets the box of half sides `half` around the origin.
pub(crate) fn segment_meets_box(from: DVec3, to: DVec3, half: DVec3) -> bool {
    let (middle, way) = (0.5 * (from + to), 0.5 * (to - from));
    let reach = way.abs();
    if middle.abs().cmpgt(half + reach).any() {
        return false;
    }
    // The axes across the segment; the margin absorbs rounding where the two just touch.
    let across = middle.cross(way).abs();
    let room = DVec3::new(
        half.y * reach.z + half.z * reach.y,
        half.x * reach.z + half.z * reach.x,
        half.x * reach.y + half.y * reach.x,
    );
    !across.cmpgt(room + 1e-12 * half.length_squared()).any()
}

/// The squared distance of a point to a triangle's plane if it projects into the triangle,
/// otherwise infinity.
fn above_triangle_squared(point: DVec3, &[a, b, c]: &[DVec3; 3]) -> f64 {
    let normal = (b - a).cross(c - a);
    let inside = |from: DVec3, to: DVec3| (to - from).cross(point - from).dot(normal) >= 0.0;
    if inside(a, b) && inside(b, c) && inside(c, a) {
        (point - a).dot(normal).powi(2) / normal.length_squared()
    } else {
        f64::INFINITY
    }
}

/// The point of a triangle nearest to a point (Ericson, section 5.1.5).
pub(crate) fn nearest_of_triangle(point: DVec3, &[a, b, c]: &[DVec3; 3]) -> DVec3 {
    let (ab, ac) = (b - a, c - a);
    let along = |from: DVec3| (ab.dot(point - from), ac.dot(point - from));
    let ((d1, d2), (d3, d4), (d5, d6)) = (along(a), along(b), along(c));
    if d1 <= 0.0 && d2 <= 0.0 {
        return a;
    }
    if d3 >= 0.0 && d4 <= d3 {
        return b;
    }
    let at_c = d1 * d4 - d3 * d2;
    if at_c <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return a + d1 / (d1 - d3) * ab;
    }
    if d6 >= 0.0 && d5 <= d6 {
        return c;
    }
    let at_b = d5 * d2 - d1 * d6;
    if at_b <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + d2 / (d2 - d6) * ac;
    }
    let at_a = d3 * d6 - d5 * d4;
    if at_a <= 0.0 && d4 >= d3 && d5 >= d6 {
        return b + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b);
    }
    let inverse = 1.0 / (at_a + at_b + at_c);
    a + ab * (at_b * inverse) + ac * (at_c * inverse)
}

/// Whether a triangle crosses the open segment.
pub(crate) fn crosses(corners: &[DVec3; 3], from: DVec3, to: DVec3) -> bool {
    crossing(corners, from, to).is_some()
}

/// Where a triangle crosses the open segment, as a share of its length (Möller and Trumbore 1997).
pub(crate) fn crossing(&[a, b, c]: &[DVec3; 3], from: DVec3, to: DVec3) -> Option<f64> {
    let (way, ab, ac) = (to - from, b - a, c - a);
    let normal = way.cross(ac);
    let determinant = ab.dot(normal);
    if determinant.abs() < 1e-30 {
        return None;
    }
    let offset = from - a;
    let u = offset.dot(normal) / determinant;
    let tilted = offset.cross(ab);
    let v = way.dot(tilted) / determinant;
    let along = ac.dot(tilted) / determinant;
    let is_crossed = u >= 0.0 && v >= 0.0 && u + v <= 1.0 && along > 0.0 && along < 1.0;
    is_crossed.then_some(along)
}

#[cfg(test)]
mod tests {
    use palpate_core::rng::{Purpose, Stream};

    use super::*;

    /// The naive form: the least distance between points sampled along both.
    fn sampled(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> f64 {
        let n = 200;
        let along = |from: DVec3, to: DVec3, step: i32| from.lerp(to, f64::from(step) / 200.0);
        (0..=n)
            .flat_map(|s| (0..=n).map(move |t| along(a, b, s).distance(along(c, d, t))))
            .fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn segment_distance_is_that_of_the_nearest_points() {
        let mut stream = Stream::new(1, Purpose::Shape, 0);
        for _ in 0..100 {
            let mut point = || stream.direction() * stream.uniform(0.1, 1.0);
            let [a, b, c, d] = [point(), point(), point(), point()];
            let distance = segment_to_segment_squared(a, b, c, d).sqrt();
            let naive = sampled(a, b, c, d);
            // Neighbouring samples are at most 0.01 apart.
            assert!(distance <= naive + 1e-12 && naive < distance + 0.01, "{distance} {naive}");
        }
    }

    #[test]
    fn nearest_point_of_a_triangle_beats_every_sampled_one() {
        let mut stream = Stream::new(4, Purpose::Shape, 0);
        for _ in 0..200 {
            let mut draw = || stream.direction() * stream.uniform(0.1, 1.0);
            let (point, corners) = (draw(), [draw(), draw(), draw()]);
            let distance = nearest_of_triangle(point, &corners).distance(point);
            let [a, b, c] = corners;
            let n = 100;
            let sampled = (0..=n)
                .flat_map(|u| (0..=n - u).map(move |v| (u, v)))
                .map(|(u, v)| a + (b - a) * f64::from(u) / 100.0 + (c - a) * f64::from(v) / 100.0)
                .map(|at| at.distance(point))
                .fold(f64::INFINITY, f64::min);
            // Neighbouring samples are at most 0.02 apart.
            assert!(distance <= sampled + 1e-12 && sampled < distance + 0.02);
        }
    }

    #[test]
    fn degenerate_and_parallel_segments_have_distances() {
        let x = DVec3::X;
        let y = DVec3::Y;
        let square = segment_to_segment_squared;
        assert!((square(DVec3::ZERO, x, y, x + y) - 1.0).abs() < 1e-15);
        // From 0..1 to 3..4 on the next line: 2 along, 1 across.
        assert!((square(DVec3::ZERO, x, 3.0 * x + y, 4.0 * x + y) - 5.0).abs() < 1e-15);
        assert!((square(x, x, 4.0 * y, 4.0 * y) - 17.0).abs() < 1e-15);
    }

    #[test]
    fn a_segment_meets_a_box_if_a_point_of_it_is_inside() {
        let half = DVec3::new(0.2, 0.3, 0.4);
        let mut stream = Stream::new(2, Purpose::Shape, 0);
        let mut n_met = 0;
        for _ in 0..2000 {
            let mut point = || stream.direction() * stream.uniform(0.0, 1.0);
            let (from, to) = (point(), point());
            let inside = |grown: f64| {
                (0..=1000).any(|step| {
                    let at = from.lerp(to, f64::from(step) / 1000.0).abs();
                    at.cmple(half + grown).all()
                })
            };
            let meets = segment_meets_box(from, to, half);
            // Neighbouring samples are at most 2 mm apart, so a grazing segment may have none
            // inside.
            assert!(meets || !inside(0.0), "{from} to {to}");
            assert!(!meets || inside(0.002), "{from} to {to}");
            n_met += usize::from(meets);
        }
        assert!((400..1600).contains(&n_met), "{n_met} of 2000");
    }

    #[test]
    fn segment_to_triangle_covers_face_edge_and_crossing() {
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let squared = |from: [f64; 3], to: [f64; 3]| {
            segment_to_triangle_squared(from.into(), to.into(), &corners)
        };
        assert!((squared([0.2, 0.2, 0.5], [0.3, 0.3, 2.0]) - 0.25).abs() < 1e-15);
        assert!((squared([-1.0, 0.5, 1.0], [-1.0, 0.5, -1.0]) - 1.0).abs() < 1e-15);
        assert!(squared([0.2, 0.2, 1.0], [0.2, 0.2, -1.0]) < 1e-15);
        // Level with the triangle and beyond the corner (1, 0, 0).
        assert!((squared([2.0, 0.0, 0.0], [3.0, 1.0, 0.0]) - 1.0).abs() < 1e-15);
    }
}
