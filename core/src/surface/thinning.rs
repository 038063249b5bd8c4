//! Thinning: which touches of a training set are worth keeping, best first.
//!
//! Source: section 5.6.3 asks for it. Touches are put into an order in which each next one
//! lies farthest from those before it, so that the first n of them cover the surface as evenly
//! as n touches can (Gonzalez, 1985); any prefix is a thinned map. Distance is that of the
//! positions, and of the normals times a length, so that both sides of a thin wall stay.

use glam::Vec3;

/// A normal turned by a radian counts as this many metres.
const NORMAL_REACH: f32 = 0.006;

/// The indices of all touches, farthest first; the first is the one nearest to the middle of
/// the list's box, so that the order does not depend on which touch came first.
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
