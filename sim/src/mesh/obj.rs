//! Wavefront OBJ through `tobj`: positions and faces of all groups, nothing else.
//!
//! Material files are not opened. Faces with fewer than three corners are ignored.

use std::io::BufReader;

use glam::DVec3;

use super::format::Soup;
use super::{MeshError, TRIANGLES_MAX, VERTICES_MAX, check_count};

pub(super) fn read(bytes: &[u8]) -> Result<Soup, MeshError> {
    check_lines(bytes)?;
    let options = tobj::LoadOptions { triangulate: true, ..Default::default() };
    let no_materials = |_: &std::path::Path| Err(tobj::LoadError::OpenFileFailed);
    let (models, _) = tobj::load_obj_buf(&mut BufReader::new(bytes), &options, no_materials)
        .map_err(MeshError::Obj)?;
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for model in models {
        let first = vertices.len() as u32;
        let positions = model.mesh.positions.as_chunks::<3>().0;
        vertices.extend(positions.iter().map(|at| DVec3::from_array(at.map(f64::from))));
        let corners = model.mesh.indices.as_chunks::<3>().0;
        triangles.extend(corners.iter().map(|at| at.map(|corner| first.saturating_add(corner))));
        check_count("vertices", vertices.len(), VERTICES_MAX)?;
        check_count("triangles", triangles.len(), TRIANGLES_MAX)?;
    }
    Ok((vertices, triangles))
}

/// Counts vertices and triangles from the words, before anything is allocated for them.
fn check_lines(bytes: &[u8]) -> Result<(), MeshError> {
    let (mut n_vertices, mut n_triangles) = (0usize, 0usize);
    for line in bytes.split(|byte| *byte == b'\n') {
        let mut words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
        match words.next() {
            Some(b"v") => n_vertices += 1,
            Some(b"f") => n_triangles += words.count().saturating_sub(2),
            _ => {}
        }
    }
    check_count("vertices", n_vertices, VERTICES_MAX)?;
    check_count("triangles", n_triangles, TRIANGLES_MAX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{Mesh, MeshFormat};

    fn from_text(text: &str) -> Result<Mesh, MeshError> {
        Mesh::from_bytes(MeshFormat::Obj, text.as_bytes(), 1e-3)
    }

    const SQUARE: &str = "mtllib none.mtl\nv 0 0 0\nv 10 0 0\nv 10 10 0\nv 0 10 0\n\
                          g a\nusemtl red\nf 1 2 3 4\ng b\nf -4 -2 -3\n";

    #[test]
    fn groups_are_joined_and_quads_cut() {
        let mesh = from_text(SQUARE).unwrap();
        assert_eq!((mesh.vertices().len(), mesh.triangles().len()), (4, 3));
    }

    #[test]
    fn bad_files_are_refused() {
        let index = from_text(&SQUARE.replace("f 1 2 3 4", "f 1 2 9"));
        assert_eq!(index, Err(MeshError::Obj(tobj::LoadError::FaceVertexOutOfBounds)));
        assert!(from_text(&SQUARE.replace("f 1 2 3 4", "f 0 1 2")).is_err());
        assert!(from_text(&SQUARE.replace("v 10 0 0", "v 10 0")).is_err());
        let nan = from_text(&SQUARE.replace("v 10 0 0", "v nan 0 0"));
        assert!(matches!(nan, Err(MeshError::NotFinite { .. })), "{nan:?}");
        assert_eq!(from_text("v 0 0 0\n"), Err(MeshError::Empty));
    }

    #[test]
    fn a_polygon_of_too_many_corners_is_refused() {
        let text = format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nf {}", "1 2 3 ".repeat(700_000));
        assert!(matches!(from_text(&text), Err(MeshError::TooMany { what: "triangles", .. })));
    }
}
