//! A bounding-volume hierarchy: finds the few triangles near a sensor or on a line.
//!
//! Boxes are in the object's frame, split at the median of the longest axis. Triangles lie in
//! the order of the leaves, so a leaf is one stretch of memory.

use glam::{DMat3, DVec3};
use palpate_core::pose::Pose;

use crate::distance::{
    crosses, crossing, nearest_of_triangle, segment_meets_box, segment_to_triangle_squared,
};
use crate::mesh::Mesh;

const LEAF_TRIANGLES_MAX: usize = 4;

/// A box, and the position of its children or triangles.
#[derive(Clone, Copy, Debug)]
struct Node {
    center: DVec3,
    half: DVec3,
    /// First triangle of a leaf; right child of an inner node (the left one follows the node).
    start: u32,
    /// Triangles of a leaf; 0 marks an inner node.
    n_triangles: u32,
}

/// The hierarchy over a mesh.
#[derive(Clone, Debug)]
pub(crate) struct Bvh {
    nodes: Vec<Node>,
    triangles: Vec<[DVec3; 3]>,
}

/// A box in the sensor frame, metres.
#[derive(Clone, Copy, Debug)]
pub(super) struct SensorBox {
    pub(super) low: DVec3,
    pub(super) high: DVec3,
}

impl Bvh {
    pub(crate) fn new(mesh: &Mesh) -> Self {
        let n = mesh.triangles().len();
        let mut order: Vec<u32> = (0..n as u32).collect();
        let centers: Vec<DVec3> =
            (0..n).map(|triangle| mesh.corners(triangle).iter().sum::<DVec3>() / 3.0).collect();
        let mut nodes = Vec::with_capacity(n);
        split(mesh, &centers, &mut order, 0, &mut nodes);
        let triangles = order.iter().map(|triangle| mesh.corners(*triangle as usize)).collect();
        Self { nodes, triangles }
    }

    /// Calls `visit` with every triangle, in the sensor frame, whose leaf meets the box
    /// `near` of that frame; some of these triangles may lie outside of it.
    pub(super) fn visit_near(
        &self,
        sensor_from_object: Pose,
        near: &SensorBox,
        mut visit: impl FnMut([DVec3; 3]),
    ) {
        let turn = DMat3::from_quat(sensor_from_object.rotation);
        let spread = DMat3::from_cols(turn.x_axis.abs(), turn.y_axis.abs(), turn.z_axis.abs());
        let shift = sensor_from_object.translation;
        let apart = |node: &Node| {
            let center = turn * node.center + shift;
            let half = spread * node.half;
            ((center - half).cmpgt(near.high) | (center + half).cmplt(near.low)).any()
        };
        self.any(apart, |corners| {
            visit(corners.map(|corner| turn * corner + shift));
            false
        });
    }

    /// Whether any triangle crosses the open segment from `from` to `to`.
    pub(super) fn hits_segment(&self, from: DVec3, to: DVec3) -> bool {
        let (middle, half_way) = (0.5 * (from + to), 0.5 * (to - from));
        // The segment's own box against the node's: enough for short segments.
        let apart =
            |node: &Node| (node.center - middle).abs().cmpgt(node.half + half_way.abs()).any();
        self.any(apart, |corners| crosses(corners, from, to))
    }

    /// The distance from `from` along the unit vector `ahead` to the first triangle within `reach`.
    pub(super) fn first_hit(&self, from: DVec3, ahead: DVec3, reach: f64) -> Option<f64> {
        let to = from + reach * ahead;
        let (middle, half_way) = (0.5 * (from + to), 0.5 * (to - from));
        let apart =
            |node: &Node| (node.center - middle).abs().cmpgt(node.half + half_way.abs()).any();
        let mut nearest: Option<f64> = None;
        self.any(apart, |corners| {
            if let Some(share) = crossing(corners, from, to)
                && nearest.is_none_or(|least| share * reach < least)
            {
                nearest = Some(share * reach);
            }
            false
        });
        nearest
    }

    /// Whether any triangle is nearer than `radius` to the segment from `from` to `to`.
    pub(super) fn is_near_segment(&self, from: DVec3, to: DVec3, radius: f64) -> bool {
        let apart = |node: &Node| {
            !segment_meets_box(from - node.center, to - node.center, node.half + radius)
        };
        let near = |corners: &_| segment_to_triangle_squared(from, to, corners) < radius * radius;
        self.any(apart, near)
    }

    /// Whether a triangle is `found` in a leaf; nodes that are `apart` are not searched.
    fn any(
        &self,
        apart: impl Fn(&Node) -> bool,
        mut found: impl FnMut(&[DVec3; 3]) -> bool,
    ) -> bool {
        let mut pending = [0u32; 64];
        let mut n_pending = 1;
        while n_pending > 0 {
            n_pending -= 1;
            let idx = pending[n_pending];
            let node = &self.nodes[idx as usize];
            if apart(node) {
                continue;
            }
            if node.n_triangles == 0 {
                pending[n_pending] = node.start;
                pending[n_pending + 1] = idx + 1;
                n_pending += 2;
                continue;
            }
            let start = node.start as usize;
            let leaf = &self.triangles[start..start + node.n_triangles as usize];
            if leaf.iter().any(&mut found) {
                return true;
            }
        }
        false
    }
}

impl Bvh {
    /// The point of the mesh nearest to a point, and the unit normal of its triangle.
    pub(crate) fn nearest(&self, point: DVec3) -> (DVec3, DVec3) {
        let box_squared = |node: &Node| {
            ((point - node.center).abs() - node.half).max(DVec3::ZERO).length_squared()
        };
        let (mut best, mut least) = (self.triangles[0], f64::INFINITY);
        let mut at = best[0];
        let mut pending = [(0u32, 0.0); 64];
        pending[0].1 = box_squared(&self.nodes[0]);
        let mut n_pending = 1;
        while n_pending > 0 {
            n_pending -= 1;
            let (idx, distance) = pending[n_pending];
            if distance >= least {
                continue;
            }
            let node = &self.nodes[idx as usize];
            if node.n_triangles == 0 {
                let children = [node.start, idx + 1]
                    .map(|child| (child, box_squared(&self.nodes[child as usize])));
                // The nearer child first.
                let [first, second] = children;
                let (near, far) =
                    if first.1 <= second.1 { (first, second) } else { (second, first) };
                pending[n_pending] = far;
                pending[n_pending + 1] = near;
                n_pending += 2;
            } else {
                let start = node.start as usize;
                for corners in &self.triangles[start..start + node.n_triangles as usize] {
                    let found = nearest_of_triangle(point, corners);
                    let squared = found.distance_squared(point);
                    if squared < least {
                        (best, least, at) = (*corners, squared, found);
                    }
                }
            }
        }
        let [a, b, c] = best;
        (at, (b - a).cross(c - a).normalize_or(DVec3::Z))
    }
}

/// Adds the node over `order` (triangles from `start` on) and everything below it.
fn split(mesh: &Mesh, centers: &[DVec3], order: &mut [u32], start: usize, nodes: &mut Vec<Node>) {
    let mut low = DVec3::INFINITY;
    let mut high = DVec3::NEG_INFINITY;
    for triangle in order.iter() {
        for corner in mesh.corners(*triangle as usize) {
            low = low.min(corner);
            high = high.max(corner);
        }
    }
    let idx = nodes.len();
    let (center, half) = (0.5 * (low + high), 0.5 * (high - low));
    nodes.push(Node { center, half, start: start as u32, n_triangles: order.len() as u32 });
    if order.len() <= LEAF_TRIANGLES_MAX {
        return;
    }
    let axis = half.to_array();
    let longest = (0..3).fold(
        0,
        |best, candidate| {
            if axis[candidate] > axis[best] { candidate } else { best }
        },
    );
    let middle = order.len() / 2;
    order.select_nth_unstable_by(middle, |&a, &b| {
        let along = |triangle: u32| centers[triangle as usize][longest];
        along(a).total_cmp(&along(b)).then(a.cmp(&b))
    });
    let (left, right) = order.split_at_mut(middle);
    split(mesh, centers, left, start, nodes);
    nodes[idx].start = nodes.len() as u32;
    nodes[idx].n_triangles = 0;
    split(mesh, centers, right, start + middle, nodes);
}

#[cfg(test)]
mod tests {
    use palpate_core::rng::{Purpose, Stream};

    use super::*;
    use crate::mesh::tests_support::sphere;

    #[test]
    fn every_triangle_is_in_exactly_one_leaf_and_within_its_box() {
        let mesh = sphere(0.03, 24);
        let bvh = Bvh::new(&mesh);
        let mut seen = 0;
        for node in bvh.nodes.iter().filter(|node| node.n_triangles > 0) {
            seen += node.n_triangles as usize;
            let start = node.start as usize;
            for corner in bvh.triangles[start..start + node.n_triangles as usize].as_flattened() {
                assert!(((*corner - node.center).abs() - node.half).max_element() < 1e-12);
            }
        }
        assert_eq!(seen, mesh.triangles().len());
    }

    #[test]
    fn segment_proximity_matches_all_triangles() {
        let mesh = sphere(0.03, 24);
        let bvh = Bvh::new(&mesh);
        let mut stream = Stream::new(1, Purpose::Shape, 0);
        let mut n_near = 0;
        for _ in 0..300 {
            let from = 0.06 * stream.direction();
            let to = from + 0.05 * stream.direction();
            let near = bvh.is_near_segment(from, to, 0.01);
            let naive = (0..mesh.triangles().len()).any(|triangle| {
                segment_to_triangle_squared(from, to, &mesh.corners(triangle)) < 0.01 * 0.01
            });
            assert_eq!(near, naive);
            n_near += usize::from(near);
        }
        assert!((30..270).contains(&n_near), "{n_near} of 300 are near");
    }

    #[test]
    fn nearest_point_matches_all_triangles() {
        let mesh = sphere(0.03, 16);
        let bvh = Bvh::new(&mesh);
        let mut stream = Stream::new(3, Purpose::Shape, 0);
        for _ in 0..300 {
            let point = stream.uniform(0.0, 0.06) * stream.direction();
            let naive = (0..mesh.triangles().len())
                .map(|triangle| nearest_of_triangle(point, &mesh.corners(triangle)))
                .map(|at| at.distance(point))
                .fold(f64::INFINITY, f64::min);
            let (at, normal) = bvh.nearest(point);
            assert!((at.distance(point) - naive).abs() < 1e-15);
            assert!(normal.dot(at) > 0.0, "{normal}");
        }
    }

    #[test]
    fn the_first_hit_of_a_ray_is_on_the_near_side() {
        let bvh = Bvh::new(&sphere(0.03, 60));
        let hit = |from: [f64; 3], reach| bvh.first_hit(from.into(), DVec3::NEG_X, reach);
        let near = hit([0.05, 0.001, 0.002], 0.1).unwrap();
        assert!((near - 0.02).abs() < 0.2e-3, "{near}");
        assert_eq!(hit([0.05, 0.001, 0.002], 0.01), None);
        assert_eq!(hit([0.05, 0.04, 0.0], 0.1), None);
        let inside = hit([0.0, 0.001, 0.002], 0.1).unwrap();
        assert!((inside - 0.03).abs() < 0.2e-3, "{inside}");
    }

    #[test]
    fn a_segment_into_a_sphere_hits_and_one_beside_it_does_not() {
        let bvh = Bvh::new(&sphere(0.03, 24));
        let hits = |from: [f64; 3], to: [f64; 3]| bvh.hits_segment(from.into(), to.into());
        assert!(hits([0.05, 0.001, 0.002], [0.0, 0.001, 0.002]));
        assert!(!hits([0.05, 0.0, 0.0], [0.04, 0.0, 0.0]));
        assert!(!hits([0.01, 0.0, 0.0], [-0.01, 0.0, 0.0]));
        assert!(!hits([0.025, 0.025, -0.05], [0.025, 0.025, 0.05]));
    }
}
