//! The OBJ reader: positions and faces of all groups and objects, nothing else.
//!
//! Texture and normal indices, materials and curves are skipped; material files are not
//! opened. Faces with fewer than three corners are ignored. A surface of curves is refused.

use glam::DVec3;

use super::polygons::{Polygons, check_count};
use super::text::{Lines, numbers};
use super::{MeshError, MeshFormat, TRIANGLES_MAX, VERTICES_MAX};

const FORMAT: MeshFormat = MeshFormat::Obj;

/// Reads the whole of a plain text; nothing follows.
pub(super) fn read<'a>(bytes: &'a [u8], polygons: &mut Polygons) -> Result<&'a [u8], MeshError> {
    let n_vertices = check_lines(bytes)?;
    let mut corners = Vec::new();
    for (line, words) in Lines::of(bytes) {
        let fault = |expected| MeshError::Syntax { format: FORMAT, line, expected };
        let mut words = words.split_ascii_whitespace();
        match words.next() {
            Some("v" | "V") => {
                let place = numbers::<3>(&mut words);
                let place = place.ok_or(fault("a vertex of three numbers such as 1.5"))?;
                polygons.vertex(DVec3::from_array(place))?;
            }
            Some("f" | "F" | "fo") => {
                corners.clear();
                for word in words {
                    let place = corner(word, polygons.n_vertices() as i64)
                        .ok_or(fault("corners such as 1, 1/2, 1//3 or -1"))?;
                    let place = u32::try_from(place).ok().filter(|at| (*at as usize) < n_vertices);
                    let corner = corners.len();
                    corners.push(place.ok_or(MeshError::Corner { line, corner, n_vertices })?);
                }
                polygons.polygon(&corners)?;
            }
            Some("surf") => return Err(fault("polygons, came a free-form surface: export it so")),
            _ => {}
        }
    }
    Ok(&bytes[bytes.len()..])
}

/// The index, from 0, of the position that a corner names. A corner counts from 1, or
/// backwards from the newest of the `n_before` so far, -1. The result may be out of range.
fn corner(word: &str, n_before: i64) -> Option<i64> {
    match word.split('/').next()?.parse::<i64>().ok()? {
        0 => None,
        back if back < 0 => Some(n_before.saturating_add(back)),
        found => Some(found - 1),
    }
}

/// Counts vertices and triangles from the words, before anything is allocated for them.
fn check_lines(text: &[u8]) -> Result<usize, MeshError> {
    let (mut n_vertices, mut n_triangles) = (0usize, 0usize);
    for (_, line) in Lines::of(text) {
        let mut words = line.split_ascii_whitespace();
        match words.next() {
            Some("v" | "V") => n_vertices += 1,
            Some("f" | "F" | "fo") => n_triangles += words.count().saturating_sub(2),
            _ => {}
        }
    }
    check_count("vertices", n_vertices, VERTICES_MAX)?;
    check_count("triangles", n_triangles, TRIANGLES_MAX)?;
    Ok(n_vertices)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Mesh;

    fn from_text(text: &str) -> Result<Mesh, MeshError> {
        Mesh::from_bytes(FORMAT, text.as_bytes(), 1e-3)
    }

    const SQUARE: &str = "mtllib none.mtl\nv 0 0 0\nv 10 0 0\nv 10 10 0\nv 0 10 0\n\
                          g a\nusemtl red\nf 1 2 3 4\ng b\nf -4 -2 -3\n";

    #[test]
    fn groups_are_joined_and_quads_cut() {
        let mesh = from_text(SQUARE).unwrap();
        assert_eq!((mesh.vertices().len(), mesh.triangles().len()), (4, 3));
    }

    #[test]
    fn only_positions_of_used_vertices_count() {
        // Without these the extent would be 1 m: vertices that no face uses are left out.
        let text = "v 0 0 0 1 0 0\nv 9 0 0\nv 0 9 0\nv 1000 0 0\nvt 0 0\nvn 0 0 1\n\
                    f 1/-4 2//7 -2/1/1 # a corner\n";
        let mesh = from_text(text).unwrap();
        assert_eq!(mesh.triangles(), [[0, 1, 2]]);
        assert!((mesh.largest_dimension() - 9e-3).abs() < 1e-9);
        assert!(Mesh::from_bytes(FORMAT, &[b"# \xe9\n", text.as_bytes()].concat(), 1.0).is_ok());
    }

    #[test]
    fn faces_may_stand_before_their_vertices() {
        let mesh = from_text("f 1 2 3\nv 0 0 0\nv 9 0 0\nv 0 9 0\n").unwrap();
        assert_eq!(mesh.triangles(), [[0, 1, 2]]);
    }

    #[test]
    fn bad_files_are_refused() {
        for corner in ["9", "-5", "9223372036854775807", "-9223372036854775808"] {
            let index = from_text(&SQUARE.replace("f 1 2 3 4", &format!("f 1 2 {corner}")));
            assert_eq!(index, Err(MeshError::Corner { line: 8, corner: 2, n_vertices: 4 }));
        }
        let line = |text: &str| match from_text(text) {
            Err(MeshError::Syntax { line, .. }) => line,
            other => panic!("{other:?}"),
        };
        assert_eq!(line(&SQUARE.replace("v 10 0 0", "v 10 0")), 3);
        assert_eq!(line(&SQUARE.replace("f 1 2 3 4", "f 1 2 x")), 8);
        assert_eq!(line(&SQUARE.replace("f 1 2 3 4", "f 0 1 2")), 8);
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
