//! Measures of a mesh: extent, area, volume, centre, and whether it is closed.

use glam::{DMat3, DVec3};
use palpate_core::metric::{Inertia, outer};

use super::Mesh;

impl Mesh {
    /// The smallest and the largest corner of the box around all vertices, metres.
    #[must_use]
    pub fn bounds(&self) -> (DVec3, DVec3) {
        let nothing = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        self.vertices.iter().fold(nothing, |(low, high), at| (low.min(*at), high.max(*at)))
    }

    /// The size of the box around all vertices along x, y and z, metres.
    #[must_use]
    pub fn extent(&self) -> DVec3 {
        let (low, high) = self.bounds();
        high - low
    }

    /// The largest component of [`Mesh::extent`], metres.
    #[must_use]
    pub fn largest_dimension(&self) -> f64 {
        self.extent().max_element()
    }

    /// The area of a triangle, square metres.
    #[must_use]
    pub fn area(&self, triangle: usize) -> f64 {
        0.5 * self.area_vector(triangle).length()
    }

    /// The unit normal of a triangle, outward when the mesh is wound correctly.
    #[must_use]
    pub fn normal(&self, triangle: usize) -> DVec3 {
        self.area_vector(triangle).normalize_or(DVec3::Z)
    }

    /// The area of the whole surface, square metres.
    #[must_use]
    pub fn surface_area(&self) -> f64 {
        (0..self.triangles.len()).map(|triangle| self.area(triangle)).sum()
    }

    /// The centroid of the surface, weighted by area. Metres.
    ///
    /// Touches spread evenly over the object have their mean here. It exists for meshes with
    /// holes too, unlike the centroid of the volume.
    #[must_use]
    pub fn centroid(&self) -> DVec3 {
        let moment: DVec3 = (0..self.triangles.len())
            .map(|triangle| {
                let [a, b, c] = self.corners(triangle);
                self.area(triangle) * (a + b + c) / 3.0
            })
            .sum();
        moment / self.surface_area()
    }

    /// The enclosed volume, cubic metres; negative when the mesh is wound inside out,
    /// meaningless when it is not closed.
    #[must_use]
    pub fn signed_volume(&self) -> f64 {
        let origin = self.vertices[0];
        (0..self.triangles.len())
            .map(|triangle| {
                let [a, b, c] = self.corners(triangle).map(|corner| corner - origin);
                a.dot(b.cross(c)) / 6.0
            })
            .sum()
    }

    /// Whether every edge is shared by exactly two triangles that run along it in opposite
    /// directions.
    #[must_use]
    pub fn is_watertight(&self) -> bool {
        let mut directed: Vec<[u32; 2]> =
            self.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).collect();
        directed.sort_unstable();
        let used_once = directed.windows(2).all(|pair| pair[0] != pair[1]);
        used_once && directed.iter().all(|&[a, b]| directed.binary_search(&[b, a]).is_ok())
    }

    /// The distribution of mass: a solid of uniform density when the mesh is closed,
    /// otherwise a uniform shell.
    #[must_use]
    pub fn inertia(&self) -> Inertia {
        let solid = self.is_watertight() && self.signed_volume().abs() > 0.0;
        let origin = self.vertices[0];
        let (mut mass, mut moment, mut second) = (0.0, DVec3::ZERO, DMat3::ZERO);
        for triangle in 0..self.triangles.len() {
            let corners = self.corners(triangle).map(|corner| corner - origin);
            let [a, b, c] = corners;
            let sum = a + b + c;
            let squares = corners.into_iter().fold(outer(sum), |sum, v| sum + outer(v));
            // A tetrahedron with its apex at the origin, or the triangle itself.
            let (part, mean, share) = if solid {
                (a.dot(b.cross(c)) / 6.0, sum / 4.0, 1.0 / 20.0)
            } else {
                (self.area(triangle), sum / 3.0, 1.0 / 12.0)
            };
            mass += part;
            moment += part * mean;
            second += part * share * squares;
        }
        let center = moment / mass;
        Inertia { center: origin + center, second_moment: second * mass.recip() - outer(center) }
    }

    /// Twice the area times the normal.
    fn area_vector(&self, triangle: usize) -> DVec3 {
        let [a, b, c] = self.corners(triangle);
        (b - a).cross(c - a)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::tests_support::cuboid;

    #[test]
    fn a_box_has_its_extent_area_and_volume() {
        let mesh = cuboid(DVec3::new(1.0, 2.0, 3.0));
        assert!((mesh.surface_area() - 22.0).abs() < 1e-12);
        assert!((mesh.signed_volume() - 6.0).abs() < 1e-12);
        assert!(mesh.translated(DVec3::X).centroid().distance(DVec3::X) < 1e-12);
        assert!((mesh.largest_dimension() - 3.0).abs() < 1e-12);
        assert!(mesh.is_watertight() && mesh.inside_out().is_watertight());
        assert!(mesh.inside_out().signed_volume() < 0.0);
    }

    #[test]
    fn closed_boxes_have_solid_moments_and_open_ones_shell() {
        // A solid's variance along a side s is s²/12.
        let mesh = cuboid(DVec3::new(1.0, 2.0, 3.0)).translated(DVec3::new(5.0, 0.0, 0.0));
        for mesh in [mesh.clone(), mesh.inside_out()] {
            let inertia = mesh.inertia();
            assert!(inertia.center.distance(DVec3::new(5.0, 0.0, 0.0)) < 1e-12);
            let expected = DMat3::from_diagonal(DVec3::new(1.0, 4.0, 9.0) / 12.0);
            assert!(inertia.second_moment.abs_diff_eq(expected, 1e-10), "{inertia:?}");
        }
        // Two triangles of a unit square, z = 0: 1/12 along x and y.
        let corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];
        let vertices = corners.map(|(x, y)| DVec3::new(x, y, 0.0)).to_vec();
        let square = Mesh::new(vertices, vec![[0, 1, 2], [0, 2, 3]]).unwrap();
        let expected = DMat3::from_diagonal(DVec3::new(1.0, 1.0, 0.0) / 12.0);
        assert!(square.inertia().second_moment.abs_diff_eq(expected, 1e-12));
        assert!(square.inertia().center.distance(DVec3::new(0.5, 0.5, 0.0)) < 1e-12);
    }

    #[test]
    fn scaling_and_moving_change_the_bounds() {
        let mesh = cuboid(DVec3::new(1.0, 2.0, 3.0)).scaled_to_largest_dimension(0.08);
        assert!((mesh.extent().z - 0.08).abs() < 1e-15);
        assert!((mesh.translated(DVec3::X).bounds().0.z + 0.04).abs() < 1e-15);
    }

    #[test]
    fn a_box_with_a_hole_or_a_turned_triangle_is_not_watertight() {
        let mesh = cuboid(DVec3::ONE);
        let open = Mesh::new(mesh.vertices().to_vec(), mesh.triangles()[1..].to_vec()).unwrap();
        assert!(!open.is_watertight());
        let mut turned = mesh.triangles().to_vec();
        turned[0].swap(0, 1);
        assert!(!Mesh::new(mesh.vertices().to_vec(), turned).unwrap().is_watertight());
    }
}
