//! Thinning: the order in which training touches are kept, best first.
//!
//! Source: section 5.6.3 proposes it. In this order each touch lies farthest from those before
//! it, so that the first n of them cover the surface as evenly as n touches can (Gonzalez,
//! 1985); any prefix is a thinned map. Distance combines that of the positions and that of the
//! normals times a length, so that both sides of a thin wall are kept.

use glam::Vec3;

/// Distance (m) equivalent to one radian between normals.
pub(crate) const NORMAL_REACH: f32 = 0.006;

/// The indices of at most `n_max` touches, farthest first. The first touch of the list comes
/// first; ties go to the earlier touch.
#[must_use]
pub fn farthest_first(places: &[(Vec3, Vec3)], n_max: usize) -> Vec<usize> {
    if places.is_empty() {
        return Vec::new();
    }
    let n = n_max.min(places.len());
    let mut order = Vec::with_capacity(n);
    let mut distances = vec![f32::INFINITY; places.len()];
    let mut next = 0;
    while order.len() < n {
        order.push(next);
        distances[next] = -1.0;
        let (position, normal) = places[next];
        let mut farthest = (next, -1.0);
        for (index, (other, facing)) in places.iter().enumerate() {
            if distances[index] < 0.0 {
                continue;
            }
            let apart = position.distance_squared(*other)
                + NORMAL_REACH * NORMAL_REACH * normal.distance_squared(*facing);
            distances[index] = distances[index].min(apart);
            if distances[index] > farthest.1 {
                farthest = (index, distances[index]);
            }
        }
        next = farthest.0;
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_core::rng::{Purpose, Stream};

    /// A place `n`/1024 m along x, so that distances are exact.
    fn along_x(n: u8) -> (Vec3, Vec3) {
        (Vec3::new(f32::from(n) / 1024.0, 0.0, 0.0), Vec3::Z)
    }

    #[test]
    fn a_line_is_halved_and_halved_again() {
        let places: Vec<(Vec3, Vec3)> = (0..=10).map(along_x).collect();
        // 0, the far end, the middle; then 2, 3, 7 and 8 are all two steps from what is there.
        assert_eq!(farthest_first(&places, 4), [0, 10, 5, 2]);
    }

    #[test]
    fn any_prefix_is_the_shorter_order() {
        let mut stream = Stream::new(1, Purpose::Shape, 0);
        let places: Vec<(Vec3, Vec3)> = (0..200)
            .map(|_| (0.04 * stream.direction().as_vec3(), stream.direction().as_vec3()))
            .collect();
        let all = farthest_first(&places, 500);
        for n in [0, 1, 17, 200] {
            assert_eq!(farthest_first(&places, n), all[..n]);
        }
        let mut sorted = all;
        sorted.sort_unstable();
        assert!(sorted.into_iter().eq(0..200), "every touch once");
    }

    #[test]
    fn both_sides_of_a_thin_wall_stay() {
        // The other side is 1 mm away, but its normal 2: as 12 mm. The neighbour is 10 mm away.
        let back = (Vec3::new(0.0, 0.0, -0.001), Vec3::NEG_Z);
        assert_eq!(farthest_first(&[along_x(0), along_x(10), back], 2), [0, 2]);
    }
}
