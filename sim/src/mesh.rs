//! A triangle mesh that is safe to compute with: finite, indexed in range, not degenerate.
//!
//! Coordinates are metres in the object's own frame. Triangles wind counter-clockwise seen
//! from outside, provided the file's triangles do. Not here: repairing holes; a mesh with
//! holes can be touched like any other.

mod format;
mod error;
mod polygons;
mod text;
mod stl;
mod obj;
mod off;
mod ply;
mod glb;
mod three_mf;
mod weld;
mod cut;
mod surface;
mod assemble;
mod read;
mod measure;
mod write;
#[cfg(test)]
pub(crate) mod tests_support;
#[cfg(test)]
mod traps;

use glam::DVec3;
use palpate_core::pose::Pose;
use polygons::check_count;

pub use error::MeshError;
pub use format::{MeshFormat, other_content};
pub use read::MeshFile;
pub use surface::{MeshRemark, SIZE_LARGE, SIZE_SMALL};

/// Maximum number of triangles.
pub const TRIANGLES_MAX: usize = 2_000_000;
/// Maximum number of vertices.
pub const VERTICES_MAX: usize = 3 * TRIANGLES_MAX;
/// Largest extent along any axis, metres.
pub const EXTENT_MAX: f64 = 1e3;
/// Lower bound of the largest dimension, metres.
pub const EXTENT_MIN: f64 = 1e-6;

/// A checked triangle mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    vertices: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// A mesh of `vertices` (metres) and `triangles` (three vertex indices each).
    ///
    /// Triangles without area are dropped; vertices stay as they are, used or not.
    ///
    /// # Errors
    /// [`MeshError`] when there is no triangle with an area, or too many; when a vertex is not
    /// finite or a triangle names one that does not exist; when the mesh is a point or larger
    /// than [`EXTENT_MAX`].
    pub fn new(vertices: Vec<DVec3>, triangles: Vec<[u32; 3]>) -> Result<Self, MeshError> {
        check_count("vertices", vertices.len(), VERTICES_MAX)?;
        check_count("triangles", triangles.len(), TRIANGLES_MAX)?;
        if let Some(vertex) = vertices.iter().position(|point| !point.is_finite()) {
            return Err(MeshError::NotFinite { vertex });
        }
        let n_vertices = vertices.len();
        for (triangle, corners) in triangles.iter().enumerate() {
            if let Some(found) = corners.iter().find(|corner| **corner as usize >= n_vertices) {
                let found = i64::from(*found);
                return Err(MeshError::Index { triangle, found, n_vertices });
            }
        }
        let mut mesh = Self { vertices, triangles };
        if mesh.triangles.is_empty() {
            return Err(MeshError::Empty);
        }
        let extent = mesh.largest_dimension();
        if extent > EXTENT_MAX {
            return Err(MeshError::Huge { extent, max: EXTENT_MAX });
        }
        mesh.drop_triangles_without_area(extent);
        if mesh.triangles.is_empty() || extent < EXTENT_MIN {
            return Err(MeshError::Degenerate { extent });
        }
        Ok(mesh)
    }

    /// The vertices, metres in the object's frame.
    #[must_use]
    pub fn vertices(&self) -> &[DVec3] {
        &self.vertices
    }

    /// The triangles, as indices of their three vertices.
    #[must_use]
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// The three corners of a triangle, metres.
    #[must_use]
    pub fn corners(&self, triangle: usize) -> [DVec3; 3] {
        self.triangles[triangle].map(|vertex| self.vertices[vertex as usize])
    }

    /// The mesh moved by `offset` metres.
    #[must_use]
    pub fn translated(&self, offset: DVec3) -> Self {
        self.mapped(|vertex| vertex + offset)
    }

    /// The mesh in another frame: `other_from_mesh`.
    #[must_use]
    pub fn moved_by(&self, other_from_mesh: Pose) -> Self {
        self.mapped(|vertex| other_from_mesh * vertex)
    }

    /// The mesh scaled about its frame's origin until its largest dimension is `size` metres.
    ///
    /// # Panics
    /// When `size` is not between [`EXTENT_MIN`] and [`EXTENT_MAX`].
    #[must_use]
    pub fn scaled_to_largest_dimension(&self, size: f64) -> Self {
        assert!((EXTENT_MIN..=EXTENT_MAX).contains(&size), "a mesh of {size} m is out of range");
        let factor = size / self.largest_dimension();
        self.mapped(|vertex| vertex * factor)
    }

    /// The mesh with every triangle wound the other way.
    #[must_use]
    pub fn inside_out(&self) -> Self {
        let triangles = self.triangles.iter().map(|&[a, b, c]| [a, c, b]).collect();
        Self { vertices: self.vertices.clone(), triangles }
    }

    fn mapped(&self, map: impl Fn(DVec3) -> DVec3) -> Self {
        let vertices = self.vertices.iter().map(|vertex| map(*vertex)).collect();
        Self { vertices, triangles: self.triangles.clone() }
    }

    /// Drops slivers thinner than rounding: twice the area below 1e-15 of the extent squared.
    fn drop_triangles_without_area(&mut self, extent: f64) {
        let smallest = 1e-15 * extent * extent;
        let Self { vertices, triangles } = self;
        triangles.retain(|corners| {
            let [a, b, c] = corners.map(|vertex| vertices[vertex as usize]);
            (b - a).cross(c - a).length() > smallest
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mesh_without_area_or_extent_is_refused() {
        let line = vec![DVec3::ZERO, DVec3::X, 2.0 * DVec3::X];
        let error = Mesh::new(line, vec![[0, 1, 2]]).unwrap_err();
        assert!(matches!(error, MeshError::Degenerate { .. }), "{error}");
        assert_eq!(Mesh::new(vec![DVec3::ZERO], vec![]), Err(MeshError::Empty));
    }

    #[test]
    fn flat_meshes_are_accepted_without_their_slivers() {
        let square = vec![DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y];
        let mesh = Mesh::new(square, vec![[0, 1, 2], [0, 2, 3], [0, 0, 1]]).unwrap();
        assert_eq!(mesh.triangles().len(), 2);
    }

    #[test]
    fn bad_vertices_and_indices_are_refused_by_number() {
        let bad = vec![DVec3::ZERO, DVec3::X, DVec3::new(0.0, f64::NAN, 0.0)];
        assert_eq!(Mesh::new(bad, vec![[0, 1, 2]]), Err(MeshError::NotFinite { vertex: 2 }));
        let good = vec![DVec3::ZERO, DVec3::X, DVec3::Y];
        let expected = MeshError::Index { triangle: 1, found: 3, n_vertices: 3 };
        assert_eq!(Mesh::new(good, vec![[0, 1, 2], [0, 1, 3]]), Err(expected));
    }

    #[test]
    fn a_huge_mesh_is_refused() {
        let huge = vec![DVec3::ZERO, 2e3 * DVec3::X, DVec3::Y];
        assert!(matches!(Mesh::new(huge, vec![[0, 1, 2]]), Err(MeshError::Huge { .. })));
        let beyond_f64 = vec![-1e308 * DVec3::X, 1e308 * DVec3::X, DVec3::Y];
        assert!(matches!(Mesh::new(beyond_f64, vec![[0, 1, 2]]), Err(MeshError::Huge { .. })));
    }
}
