//! Welding: one vertex per position, so that neighbouring triangles share them, and none that no
//! polygon uses.
//!
//! STL repeats every vertex for every triangle; other formats repeat them along seams.

use std::cmp::Ordering;

use super::MeshError;
use super::polygons::Polygons;

/// Joins vertices at exactly the same position and drops the unused, in order of first occurrence.
pub(super) fn weld(polygons: &mut Polygons) -> Result<(), MeshError> {
    let vertices = std::mem::take(&mut polygons.vertices);
    let mut is_used = vec![false; vertices.len()];
    for corner in polygons.corners_mut() {
        is_used[*corner as usize] = true;
    }
    let mut by_place: Vec<u32> =
        (0..vertices.len() as u32).filter(|vertex| is_used[*vertex as usize]).collect();
    let place = |vertex: u32| vertices[vertex as usize].to_array();
    if let Some(vertex) = by_place.iter().find(|vertex| !vertices[**vertex as usize].is_finite()) {
        return Err(MeshError::NotFinite { vertex: *vertex as usize });
    }
    let order = |a: [f64; 3], b: [f64; 3]| {
        // `partial_cmp` treats 0 and -0 as equal, as welding must.
        a.partial_cmp(&b).unwrap_or(Ordering::Equal)
    };
    by_place.sort_unstable_by(|&a, &b| order(place(a), place(b)).then(a.cmp(&b)));
    // The first of each group of equal positions represents the group.
    let mut welded_idx = vec![u32::MAX; vertices.len()];
    let mut first = 0;
    for (rank, &vertex) in by_place.iter().enumerate() {
        if rank == 0 || order(place(first), place(vertex)).is_ne() {
            first = vertex;
        }
        welded_idx[vertex as usize] = first;
    }
    for vertex in 0..vertices.len() {
        let stands_for = welded_idx[vertex];
        if stands_for as usize == vertex {
            welded_idx[vertex] = polygons.vertices.len() as u32;
            polygons.vertices.push(vertices[vertex]);
        } else if stands_for != u32::MAX {
            // The first of a group comes first and has its number already.
            welded_idx[vertex] = welded_idx[stands_for as usize];
        }
    }
    for corner in polygons.corners_mut() {
        *corner = welded_idx[*corner as usize];
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    #[test]
    fn vertices_at_one_place_become_one_and_the_unused_none() {
        let mut polygons = Polygons::default();
        let unused = DVec3::splat(f64::NAN);
        let corner = DVec3::new(1.0, 1.0, -0.0);
        for place in [DVec3::ZERO, unused, DVec3::X, DVec3::Y, DVec3::X, DVec3::Y, corner] {
            polygons.vertex(place).unwrap();
        }
        polygons.polygon(&[0, 2, 3]).unwrap();
        polygons.polygon(&[5, 4, 6]).unwrap();
        weld(&mut polygons).unwrap();
        assert_eq!(polygons.vertices, [DVec3::ZERO, DVec3::X, DVec3::Y, corner]);
        assert_eq!((polygons.get(0), polygons.get(1)), (&[0, 1, 2][..], &[2, 1, 3][..]));
    }
}
