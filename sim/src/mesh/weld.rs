//! Welding: joins vertices at exactly the same position, so that neighbouring triangles share
//! them.
//!
//! STL repeats every vertex for every triangle; other formats repeat them along seams.

use glam::DVec3;

use super::MeshError;
use super::format::Soup;

/// The soup in metres, with one vertex per position, in order of first occurrence.
pub(super) fn weld(
    vertices: &[DVec3],
    triangles: Vec<[u32; 3]>,
    unit: f64,
) -> Result<Soup, MeshError> {
    let n_vertices = vertices.len();
    if let Some(vertex) = vertices.iter().position(|point| !point.is_finite()) {
        return Err(MeshError::NotFinite { vertex });
    }
    let mut by_place: Vec<u32> = (0..n_vertices as u32).collect();
    let place = |vertex: u32| vertices[vertex as usize].to_array();
    let order = |a: [f64; 3], b: [f64; 3]| {
        // `partial_cmp` treats 0 and -0 as equal, as welding must.
        a.partial_cmp(&b).unwrap_or(std::cmp::Ordering::Equal)
    };
    by_place.sort_by(|&a, &b| order(place(a), place(b)).then(a.cmp(&b)));
    // The first of each group of equal positions represents the group.
    let mut representative = vec![0u32; n_vertices];
    let mut first = 0;
    for (rank, &vertex) in by_place.iter().enumerate() {
        if rank == 0 || order(place(first), place(vertex)).is_ne() {
            first = vertex;
        }
        representative[vertex as usize] = first;
    }
    let mut welded_idx = vec![0u32; n_vertices];
    let mut welded = Vec::new();
    for vertex in 0..n_vertices {
        let stands_for = representative[vertex] as usize;
        if stands_for == vertex {
            welded_idx[vertex] = welded.len() as u32;
            welded.push(vertices[vertex] * unit);
        } else {
            welded_idx[vertex] = welded_idx[stands_for];
        }
    }
    let mut joined = triangles;
    for (triangle, corners) in joined.iter_mut().enumerate() {
        for corner in corners {
            let found = i64::from(*corner);
            *corner = *welded_idx.get(*corner as usize).ok_or(MeshError::Index {
                triangle,
                found,
                n_vertices,
            })?;
        }
    }
    Ok((welded, joined))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vertices_at_one_place_become_one() {
        let vertices =
            [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::X, DVec3::Y, DVec3::new(1.0, 1.0, -0.0)];
        let (welded, triangles) = weld(&vertices, vec![[0, 1, 2], [4, 3, 5]], 1e-3).unwrap();
        assert_eq!(welded.len(), 4);
        assert_eq!(triangles, [[0, 1, 2], [2, 1, 3]]);
        assert!((welded[1].x - 1e-3).abs() < 1e-15);
    }
}
