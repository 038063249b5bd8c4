//! A letter as a solid: its polygons extruded below their face.

use std::collections::BTreeSet;

use earcut::Earcut;
use glam::{DVec2, DVec3};

use super::{Letter, Polygon};
use crate::mesh::{EXTENT_MAX, Mesh};

impl Letter {
    /// The raised letter: its face in z = 0, its back `thickness` metres below; closed, with
    /// outward normals. A letter of two polygons has two bodies.
    ///
    /// # Panics
    /// When `thickness` is not positive, or larger than a mesh may be.
    #[must_use]
    pub fn solid(&self, thickness: f64) -> Mesh {
        let possible = thickness > 0.0 && thickness <= EXTENT_MAX;
        assert!(possible, "a letter of {thickness} m thickness is out of range");
        let mut vertices = Vec::new();
        let mut triangles = Vec::new();
        for polygon in &self.polygons {
            extrude(polygon, thickness, &mut vertices, &mut triangles);
        }
        Mesh::new(vertices, triangles).expect("a letter covers an area")
    }
}

fn extrude(
    polygon: &Polygon,
    thickness: f64,
    vertices: &mut Vec<DVec3>,
    triangles: &mut Vec<[u32; 3]>,
) {
    let (corners, face) = triangulated(polygon);
    let (front, n) = (vertices.len() as u32, corners.len() as u32);
    let back = front + n;
    for z in [0.0, -thickness] {
        vertices.extend(corners.iter().map(|corner| corner.extend(z)));
    }
    for &[a, b, c] in &face {
        triangles.push([front + a, front + b, front + c]);
        triangles.push([back + a, back + c, back + b]);
    }
    // The walls stand on the edges that belong to one triangle of the face only. The solid stays
    // closed even if the triangulation leaves out corners.
    let edges: BTreeSet<[u32; 2]> =
        face.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).collect();
    for &[a, b] in edges.iter().filter(|[a, b]| !edges.contains(&[*b, *a])) {
        triangles.push([front + b, front + a, back + a]);
        triangles.push([front + b, back + a, back + b]);
    }
}

/// The corners of a polygon and its triangles, counter-clockwise.
fn triangulated(polygon: &Polygon) -> (Vec<DVec2>, Vec<[u32; 3]>) {
    let mut corners = polygon.outline.clone();
    let mut hole_starts: Vec<u32> = Vec::with_capacity(polygon.holes.len());
    for hole in &polygon.holes {
        hole_starts.push(corners.len() as u32);
        corners.extend(hole);
    }
    let mut indices = Vec::new();
    Earcut::new().earcut(corners.iter().map(|at| at.to_array()), &hole_starts, &mut indices);
    let (chunks, _) = indices.as_chunks::<3>();
    let triangles = chunks
        .iter()
        .map(|&[a, b, c]| {
            let [at_a, at_b, at_c] = [a, b, c].map(|corner| corners[corner as usize]);
            let left_turn = (at_b - at_a).perp_dot(at_c - at_a) > 0.0;
            if left_turn { [a, b, c] } else { [a, c, b] }
        })
        .collect();
    (corners, triangles)
}

#[cfg(test)]
mod tests {
    use palpate_core::units::MM;

    use crate::letters::Font;

    #[test]
    fn letters_are_closed_solids_of_area_times_thickness() {
        for letter in Font::built_in().letters() {
            let solid = letter.solid(3.0 * MM);
            assert!(solid.is_watertight(), "{}", letter.symbol());
            let volume = letter.area() * 3.0 * MM;
            let off = solid.signed_volume() / volume - 1.0;
            assert!(off.abs() < 1e-6, "{}: {off}", letter.symbol());
            let (low, high) = solid.bounds();
            assert!(high.z.abs() < 1e-12 && (low.z + 3.0 * MM).abs() < 1e-12);
        }
    }
}
