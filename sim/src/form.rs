//! Numbers of a shape that no motion changes, by which one object added twice is found.
//!
//! Moments of the surface about its centroid, exact for flat triangles, so that the cutting into
//! triangles and the file format do not matter. Not here: what touch can tell apart.

use glam::{DMat3, DVec3};
use palpate_core::metric::outer;

use crate::mesh::Mesh;

/// Relative difference of sizes, and of the other numbers, up to which two shapes are equal.
/// Chosen: different cuttings of one curved part differ by less.
const SIZE_EQUAL: f64 = 0.005;
const MOMENTS_EQUAL: f64 = 0.01;

/// A shape's size, and moments as multiples of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Form {
    /// Root of the mean squared distance of the surface from its centroid, metres.
    size: f64,
    /// Area, second and third moments. The last one changes its sign in a mirror.
    moments: [f64; 7],
}

impl Form {
    /// The form of a mesh.
    #[must_use]
    pub fn of(mesh: &Mesh) -> Self {
        let (centroid, mut area) = (mesh.centroid(), 0.0);
        let (mut second, mut third) = (DMat3::ZERO, [DMat3::ZERO; 3]);
        for triangle in 0..mesh.triangles().len() {
            let [a, b, c] = mesh.corners(triangle).map(|corner| corner - centroid);
            let share = mesh.area(triangle);
            area += share;
            // Exact for polynomials of degree 3 (Strang and Fix, 1973).
            let corners = [a, b, c].map(|at| (at, 1.0 / 20.0));
            let middles = [a + b, b + c, c + a].map(|sum| (0.5 * sum, 2.0 / 15.0));
            let middle = ((a + b + c) / 3.0, 9.0 / 20.0);
            for (at, weight) in corners.into_iter().chain(middles).chain([middle]) {
                let product = outer(at) * (share * weight);
                second += product;
                for (axis, part) in third.iter_mut().enumerate() {
                    *part += product * at[axis];
                }
            }
        }
        let trace = |m: &DMat3| m.x_axis.x + m.y_axis.y + m.z_axis.z;
        let size = (trace(&second) / area).sqrt();
        let second = second * (1.0 / (area * size.powi(2)));
        let third = third.map(|part| part * (1.0 / (area * size.powi(3))));
        let lean = DVec3::from_array([0, 1, 2].map(|axis| trace(&third[axis])));
        let squares = |m: &DMat3| m.to_cols_array().iter().map(|value| value * value).sum::<f64>();
        let (once, twice) = (second * lean, second * (second * lean));
        let moments = [
            (area.sqrt() / size).ln(),
            trace(&(second * second)),
            trace(&(second * second * second)),
            lean.length(),
            third.iter().map(squares).sum::<f64>().sqrt(),
            lean.dot(once).max(0.0).sqrt(),
            lean.dot(once.cross(twice)).cbrt(),
        ];
        Self { size, moments }
    }

    /// Whether two shapes are equal up to a motion, for all that these numbers tell.
    #[must_use]
    pub fn equals(&self, other: &Self) -> bool {
        let both = self.moments.iter().zip(&other.moments);
        (self.size - other.size).abs() <= SIZE_EQUAL * self.size.max(other.size)
            && both.into_iter().all(|(a, b)| (a - b).abs() <= MOMENTS_EQUAL)
    }
}

#[cfg(test)]
mod tests {
    use palpate_core::pose::Pose;

    use super::*;
    use crate::shapes;

    /// A mesh with its vertices moved, cut into smaller triangles at the middles of its edges.
    fn recut(mesh: &Mesh, moved: impl Fn(DVec3) -> DVec3, is_turned: bool) -> Mesh {
        let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
        for triangle in 0..mesh.triangles().len() {
            let [a, b, c] = mesh.corners(triangle);
            let all = [a, b, c, 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)];
            let first = vertices.len() as u32;
            vertices.extend(all.map(&moved));
            for [i, j, k] in [[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]] {
                let corners = if is_turned { [i, k, j] } else { [i, j, k] };
                triangles.push(corners.map(|corner: u32| corner + first));
            }
        }
        Mesh::new(vertices, triangles).unwrap()
    }

    #[test]
    fn a_moved_and_recut_mesh_has_the_same_form() {
        let pose = Pose::from_parts(glam::DQuat::from_rotation_x(1.1), DVec3::new(0.3, 0.1, 2.0));
        for name in shapes::NAMES {
            let mesh = shapes::example(name).unwrap();
            let again = recut(&mesh, |at| pose * at, false);
            assert!(Form::of(&mesh).equals(&Form::of(&again)), "{name}");
        }
    }

    #[test]
    fn other_objects_sizes_and_strong_mirrors_differ() {
        let forms: Vec<Form> =
            shapes::NAMES.iter().map(|name| Form::of(&shapes::example(name).unwrap())).collect();
        for (at, one) in forms.iter().enumerate() {
            assert!(forms[at + 1..].iter().all(|other| !one.equals(other)), "{at}");
        }
        let mug = shapes::example("mug").unwrap();
        let larger = recut(&mug, |at| 1.02 * at, false);
        assert!(!Form::of(&mug).equals(&Form::of(&larger)));
        // Three rods of different lengths along the axes of a corner, and its mirror image.
        let corner = crate::mesh::Mesh::new(
            vec![DVec3::ZERO, 0.09 * DVec3::X, 0.05 * DVec3::Y, 0.02 * DVec3::Z],
            vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
        )
        .unwrap();
        let mirrored = recut(&corner, |at| at * DVec3::new(-1.0, 1.0, 1.0), true);
        assert!(!Form::of(&corner).equals(&Form::of(&mirrored)));
    }
}
