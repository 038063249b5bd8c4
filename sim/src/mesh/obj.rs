//! The OBJ parser: positions and faces of all groups, nothing else.
//!
//! Texture and normal indices, materials and curves are skipped; material files are not
//! opened. Faces with fewer than three corners are ignored. Coordinates have single
//! precision, as most programs write them.

use glam::DVec3;

use super::format::{Soup, push_fan};
use super::{MeshError, MeshFormat, TRIANGLES_MAX, VERTICES_MAX, check_count};

const FORMAT: MeshFormat = MeshFormat::Obj;

pub(super) fn read(bytes: &[u8]) -> Result<Soup, MeshError> {
    // Names and comments may be in any encoding; numbers are ASCII.
    let text = String::from_utf8_lossy(bytes);
    check_lines(&text)?;
    let positions = positions(&text)?;
    let mut used = Used { places: vec![None; positions.len()], vertices: Vec::new() };
    let (mut triangles, mut corners) = (Vec::new(), Vec::new());
    let (mut n_before, mut n_faces) = (0, 0);
    for (number, line) in lines(&text) {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => n_before += 1,
            Some("f") => {
                corners.clear();
                for word in words {
                    let place = corner(word, number, n_before)?;
                    let position = usize::try_from(place).ok().filter(|at| *at < positions.len());
                    let position = position.ok_or(MeshError::Corner {
                        line: number,
                        corner: corners.len(),
                        n_vertices: positions.len(),
                    })?;
                    corners.push(used.place(position, &positions));
                }
                push_fan(&mut triangles, &corners, n_faces, used.vertices.len())?;
                n_faces += 1;
            }
            _ => {}
        }
    }
    Ok((used.vertices, triangles))
}

/// The lines without comments, with their numbers from 1.
fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let bare = |line: &str| line.find('#').unwrap_or(line.len());
    text.lines().enumerate().map(move |(idx, line)| (idx + 1, &line[..bare(line)]))
}

fn positions(text: &str) -> Result<Vec<DVec3>, MeshError> {
    let mut positions = Vec::new();
    for (number, line) in lines(text) {
        let mut words = line.split_whitespace();
        if words.next() == Some("v") {
            positions.push(position(words).ok_or(MeshError::Syntax {
                format: FORMAT,
                line: number,
                expected: "a vertex of three numbers",
            })?);
        }
    }
    Ok(positions)
}

/// The vertices that faces use, in the order of first use; the others are not part of the mesh.
struct Used {
    places: Vec<Option<u32>>,
    vertices: Vec<DVec3>,
}

impl Used {
    /// The index of a position among the used ones, which it joins if it is new.
    fn place(&mut self, corner: usize, positions: &[DVec3]) -> u32 {
        let Self { places, vertices } = self;
        *places[corner].get_or_insert_with(|| {
            vertices.push(positions[corner]);
            // Vertices are counted beforehand, and far fewer than 32 bits hold.
            vertices.len() as u32 - 1
        })
    }
}

fn position<'a>(mut words: impl Iterator<Item = &'a str>) -> Option<DVec3> {
    let mut number = || words.next()?.parse::<f32>().ok().map(f64::from);
    Some(DVec3::new(number()?, number()?, number()?))
}

/// The index, from 0, of the position that a corner names. A corner counts from 1, or
/// backwards from the newest of the `n_before` so far, -1. The result may be out of range.
fn corner(word: &str, line: usize, n_before: i64) -> Result<i64, MeshError> {
    let number = word.split('/').next().unwrap_or_default().parse::<i64>();
    let expected = "corners such as 1, 1/2, 1//3 or -1";
    match number {
        Ok(back) if back < 0 => Ok(n_before.saturating_add(back)),
        Ok(found) if found > 0 => Ok(found - 1),
        _ => Err(MeshError::Syntax { format: FORMAT, line, expected }),
    }
}

/// Counts vertices and triangles from the words, before anything is allocated for them.
fn check_lines(text: &str) -> Result<(), MeshError> {
    let (mut n_vertices, mut n_triangles) = (0usize, 0usize);
    for line in text.lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => n_vertices += 1,
            Some("f") => n_triangles += words.count().saturating_sub(2),
            _ => {}
        }
    }
    check_count("vertices", n_vertices, VERTICES_MAX)?;
    check_count("triangles", n_triangles, TRIANGLES_MAX)
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
