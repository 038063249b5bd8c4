//! Cuts a polygon into triangles by its ears, in its own plane.
//!
//! An ear is a corner that turns outwards and whose triangle holds no other corner, not even on
//! its rim: so corners in the middle of a straight side stay corners, and neighbouring polygons
//! stay joined. Cutting an ear changes only its two neighbours, hence (corners × corners that do
//! not turn outwards) steps. `earcut`, used for letters, drops corners on straight sides and has no
//! bound for polygons that cross themselves.

use std::collections::VecDeque;

use glam::{DVec2, DVec3};

/// Cuts the polygon of the `corners` into triangles of their numbers, and gives them to `add`;
/// false if the polygon crosses itself, so that its rest was cut as a fan.
///
/// `flat` is twice the area of a triangle without area. The triangles wind as the polygon does.
/// `steps` is the remaining work budget of the file; polygons beyond it become fans.
pub(super) fn cut(
    corners: &[DVec3],
    flat: f64,
    steps: &mut u64,
    mut add: impl FnMut([usize; 3]),
) -> bool {
    if corners.len() == 3 {
        add([0, 1, 2]);
        return true;
    }
    let mut ring = Ring::new(corners, flat);
    let n = corners.len();
    let mut waiting: VecDeque<usize> = (1..n).chain([0]).collect();
    let mut is_waiting = vec![true; n];
    let mut left = n;
    while left > 3 {
        let Some(corner) = waiting.pop_front() else { break };
        is_waiting[corner] = false;
        if *steps == 0 {
            break;
        }
        if !ring.turns_left(corner) {
            continue;
        }
        *steps = steps.saturating_sub(ring.blockers.len() as u64);
        if !ring.is_empty(corner) {
            continue;
        }
        let [before, after] = ring.neighbors[corner];
        add(ring.triangle(corner));
        ring.remove(corner);
        left -= 1;
        for neighbor in [after, before] {
            if !is_waiting[neighbor] {
                is_waiting[neighbor] = true;
                waiting.push_front(neighbor);
            }
        }
    }
    // The last triangle, or a fan of what has no ear.
    let first = ring.first;
    let mut at = ring.neighbors[first][1];
    let mut all_turn = true;
    for _ in 2..left {
        let next = ring.neighbors[at][1];
        let area = ring.turn(first, at, next);
        all_turn &= area >= -flat;
        add([first, at, next]);
        at = next;
    }
    left == 3 && all_turn
}

/// The corners that are left, in the plane of the polygon, seen so that it turns left.
struct Ring {
    places: Vec<DVec2>,
    neighbors: Vec<[usize; 2]>,
    /// The corners that do not turn left: only they can lie in an ear.
    blockers: Vec<usize>,
    first: usize,
    flat: f64,
}

impl Ring {
    fn new(corners: &[DVec3], flat: f64) -> Self {
        let n = corners.len();
        let origin = corners[0];
        let normal: DVec3 =
            corners.windows(2).map(|pair| (pair[0] - origin).cross(pair[1] - origin)).sum();
        let (x, y) = normal.normalize_or(DVec3::Z).any_orthonormal_pair();
        let places: Vec<DVec2> = corners
            .iter()
            .map(|corner| *corner - origin)
            .map(|corner| DVec2::new(corner.dot(x), corner.dot(y)))
            .collect();
        let neighbors = (0..n).map(|idx| [(idx + n - 1) % n, (idx + 1) % n]).collect();
        let mut ring = Self { places, neighbors, blockers: Vec::new(), first: 0, flat };
        ring.blockers = (0..n).filter(|corner| !ring.turns_left(*corner)).collect();
        ring
    }

    /// Twice the area of a triangle, negative if it turns right.
    fn turn(&self, a: usize, b: usize, c: usize) -> f64 {
        let [a, b, c] = [a, b, c].map(|corner| self.places[corner]);
        (b - a).perp_dot(c - a)
    }

    fn triangle(&self, corner: usize) -> [usize; 3] {
        let [before, after] = self.neighbors[corner];
        [before, corner, after]
    }

    fn turns_left(&self, corner: usize) -> bool {
        let [before, corner, after] = self.triangle(corner);
        self.turn(before, corner, after) > self.flat
    }

    /// Whether the triangle of a corner holds no other.
    fn is_empty(&self, corner: usize) -> bool {
        let [a, b, c] = self.triangle(corner).map(|corner| self.places[corner]);
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        self.blockers.iter().all(|&other| {
            let at = self.places[other];
            // Corners at the same place are where a hole is joined to the outline.
            at.cmplt(low).any()
                || at.cmpgt(high).any()
                || [a, b, c].contains(&at)
                || [(a, b), (b, c), (c, a)]
                    .iter()
                    .any(|(from, to)| (*to - *from).perp_dot(at - *from) < -self.flat)
        })
    }

    /// Cuts a corner off.
    fn remove(&mut self, corner: usize) {
        let [before, after] = self.neighbors[corner];
        self.neighbors[before][1] = after;
        self.neighbors[after][0] = before;
        if self.first == corner {
            self.first = after;
        }
        for neighbor in [before, after] {
            if self.turns_left(neighbor)
                && let Ok(at) = self.blockers.binary_search(&neighbor)
            {
                self.blockers.remove(at);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    /// The triangles of a polygon in the plane z = 0; its area must be theirs, none turned.
    #[track_caller]
    fn check(outline: &[[f64; 2]]) -> Vec<[usize; 3]> {
        let corners: Vec<DVec3> = outline.iter().map(|[x, y]| DVec3::new(*x, *y, 0.0)).collect();
        let area = |corners: &[DVec3]| -> f64 {
            corners
                .windows(2)
                .map(|pair| (pair[0] - corners[0]).cross(pair[1] - corners[0]).z)
                .sum()
        };
        let (mut triangles, mut steps) = (Vec::new(), u64::MAX);
        assert!(cut(&corners, 1e-12, &mut steps, |triangle| triangles.push(triangle)));
        assert_eq!(triangles.len(), outline.len() - 2);
        let areas: Vec<f64> =
            triangles.iter().map(|triangle| area(&triangle.map(|at| corners[at]))).collect();
        assert!(areas.iter().all(|area| *area > 0.0), "{areas:?}");
        assert!((areas.iter().sum::<f64>() - area(&corners)).abs() < 1e-9 * area(&corners).abs());
        triangles
    }

    fn rotations(outline: &[[f64; 2]]) -> impl Iterator<Item = Vec<[f64; 2]>> {
        (0..outline.len()).map(|first| {
            let (end, begin) = outline.split_at(first);
            [begin, end].concat()
        })
    }

    #[test]
    fn concave_polygons_are_cut_right_from_any_corner() {
        let l = [[40., 0.], [40., 10.], [10., 10.], [10., 40.], [0., 40.], [0., 0.]];
        let comb: Vec<[f64; 2]> = (0..20)
            .map(|tooth| [20.0 - f64::from(tooth), if tooth % 2 == 0 { 9.0 } else { 1.0 }])
            .chain([[0.5, 0.0], [21.0, 0.0]])
            .collect();
        // A square with a square hole, joined to the outline by a double line.
        let hole = [
            [0., 0.],
            [9., 0.],
            [9., 9.],
            [0., 9.],
            [0., 0.],
            [3., 3.],
            [3., 6.],
            [6., 6.],
            [6., 3.],
            [3., 3.],
        ];
        let star: Vec<[f64; 2]> = (0..14)
            .map(|point| {
                let (angle, radius) =
                    (TAU * f64::from(point) / 14.0, f64::from(1 + 3 * (point % 2)));
                [radius * angle.cos(), radius * angle.sin()]
            })
            .collect();
        for outline in [&l[..], &comb, &hole, &star] {
            rotations(outline).for_each(|outline| drop(check(&outline)));
        }
    }

    #[test]
    fn corners_on_straight_sides_stay_corners() {
        let square =
            [[0., 0.], [1., 0.], [2., 0.], [2., 1.], [2., 2.], [1., 2.], [0., 2.], [0., 1.]];
        rotations(&square).for_each(|outline| drop(check(&outline)));
    }

    #[test]
    fn convex_polygons_are_fans() {
        assert_eq!(check(&[[0., 0.], [1., 0.], [1., 1.], [0., 1.]]), [[0, 1, 2], [0, 2, 3]]);
    }

    #[test]
    fn polygons_that_cross_themselves_are_said_and_end() {
        let bow = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::X + DVec3::Y];
        assert!(!cut(&bow, 1e-12, &mut 1000, |_| ()));
        let mut n = 0;
        let scattered: Vec<DVec3> = (0..3000)
            .map(f64::from)
            .map(|idx| DVec3::new((idx * 12.9898).sin(), (idx * 78.233).sin(), 0.0))
            .collect();
        assert!(!cut(&scattered, 1e-12, &mut 1_000_000, |_| n += 1));
        assert_eq!(n, 2998);
    }
}
