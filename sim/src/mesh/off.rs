//! The OFF reader: a header, counts, vertices, polygons, line by line.
//!
//! Reads `OFF` with the letters for normals, colours, textures and a fourth coordinate in front
//! of it, or without any header, as Geomview allows; counts on the same or the next line. What
//! follows the coordinates or corners on a line is ignored.

use glam::DVec3;

use super::polygons::{Polygons, check_count};
use super::text::{Lines, numbers};
use super::{MeshError, MeshFormat, TRIANGLES_MAX, VERTICES_MAX};

const FORMAT: MeshFormat = MeshFormat::Off;
/// The shortest vertex, "0 0 0" and a line's end, and the shortest polygon, "3 0 1 2".
const VERTEX_BYTES_MIN: usize = 6;
const POLYGON_BYTES_MIN: usize = 2;

/// Reads one object of a plain text; returns what follows.
pub(super) fn read<'a>(bytes: &'a [u8], polygons: &mut Polygons) -> Result<&'a [u8], MeshError> {
    let mut lines = Content(Lines::of(bytes));
    let (is_projective, [n_vertices, n_polygons]) =
        read_header(&mut lines, polygons.vertices.is_empty())?;
    check_count("vertices", n_vertices, VERTICES_MAX)?;
    check_count("polygons", n_polygons, TRIANGLES_MAX)?;
    let expected = n_vertices * VERTEX_BYTES_MIN + n_polygons * POLYGON_BYTES_MIN;
    if bytes.len() < expected {
        return Err(MeshError::Truncated { format: FORMAT, found: bytes.len(), expected });
    }
    for _ in 0..n_vertices {
        let line = lines.next("a vertex of three numbers")?;
        let mut words = line.split_ascii_whitespace();
        let place = if is_projective {
            numbers(&mut words).map(|[x, y, z, w]: [f64; 4]| DVec3::new(x, y, z) / w)
        } else {
            numbers(&mut words).map(DVec3::from_array)
        };
        polygons.vertex(place.ok_or_else(|| lines.fault("a vertex of three numbers"))?)?;
    }
    let mut corners = Vec::new();
    for _ in 0..n_polygons {
        let line = lines.next("a polygon: a count and as many vertices")?;
        if !read_polygon(line, &mut corners) {
            return Err(lines.fault("a polygon: a count and as many vertices"));
        }
        polygons.polygon(&corners)?;
    }
    Ok(lines.0.rest)
}

/// Lines with content.
struct Content<'a>(Lines<'a>);

impl<'a> Content<'a> {
    fn next(&mut self, expected: &'static str) -> Result<&'a str, MeshError> {
        let mut lines = self.0.by_ref().map(|(_, line)| line.trim_ascii());
        if let Some(line) = lines.find(|line| !line.is_empty()) {
            return Ok(line);
        }
        self.0.line += 1;
        Err(self.fault(expected))
    }

    fn fault(&self, expected: &'static str) -> MeshError {
        MeshError::Syntax { format: FORMAT, line: self.0.line, expected }
    }
}

/// Whether vertices have a fourth coordinate by which they are divided, and the counts.
///
/// The word OFF may be missing where a file begins, not between objects.
fn read_header(lines: &mut Content<'_>, is_first: bool) -> Result<(bool, [usize; 2]), MeshError> {
    let first = lines.next("the word OFF")?;
    let word = first.split_ascii_whitespace().next().unwrap_or_default();
    let is_header = word.len() <= 7 && word.to_ascii_uppercase().ends_with("OFF");
    let (prefix, rest) = if is_header {
        (&word[..word.len() - 3], first[word.len()..].trim_ascii())
    } else if is_first && word.parse::<usize>().is_ok() {
        ("", first)
    } else {
        return Err(lines.fault("the word OFF"));
    };
    if prefix.contains('n') && word.ends_with("OFF") {
        return Err(lines.fault("three dimensions, came nOFF"));
    }
    if rest.to_ascii_uppercase().starts_with("BINARY") {
        return Err(lines.fault("text, came binary OFF: export it as text"));
    }
    let expected = "counts of vertices, polygons and edges";
    let counts = if rest.is_empty() { lines.next(expected)? } else { rest };
    let mut words = counts.split_ascii_whitespace().map(str::parse);
    match (words.next(), words.next()) {
        (Some(Ok(n_vertices)), Some(Ok(n_polygons))) => {
            Ok((prefix.contains('4'), [n_vertices, n_polygons]))
        }
        _ => Err(lines.fault(expected)),
    }
}

/// Reads "n i₁ … iₙ" into `corners`; false if the line has another form.
fn read_polygon(line: &str, corners: &mut Vec<u32>) -> bool {
    corners.clear();
    let mut words = line.split_ascii_whitespace();
    let Some(Ok(n)) = words.next().map(str::parse::<usize>) else { return false };
    corners.extend(words.by_ref().map_while(|word| word.parse::<u32>().ok()).take(n));
    corners.len() == n
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Mesh;

    fn from_text(text: &str) -> Result<Mesh, MeshError> {
        Mesh::from_bytes(FORMAT, text.as_bytes(), 1e-3)
    }

    #[test]
    fn a_square_becomes_two_triangles_in_metres() {
        let text = "OFF # a square\n4 1 0\n0 0 0\n10 0 0\n\n10 10 0\n0 10 0\n4 0 1 2 3 255 0 0\n";
        let mesh = from_text(text).unwrap();
        assert_eq!(mesh.triangles(), [[0, 1, 2], [0, 2, 3]]);
        assert!((mesh.surface_area() - 1e-4).abs() < 1e-12);
        assert!(from_text(&text.replace("OFF # a square\n", "OFF ")).is_ok());
    }

    #[test]
    fn bad_files_are_refused_with_their_line() {
        let good = "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
        assert!(from_text(good).is_ok());
        let syntax = |text: &str| match from_text(text) {
            Err(MeshError::Syntax { line, .. }) => line,
            other => panic!("{other:?}"),
        };
        assert_eq!(syntax("PLX\n"), 1);
        assert_eq!(syntax("OFF\n3 x\n"), 2);
        assert_eq!(syntax(&good.replace("1 0 0", "1 0")), 4);
        assert_eq!(syntax(&good.replace("3 0 1 2", "4 0 1 2")), 6);
        assert_eq!(syntax(&good.replace("3 0 1 2", "# nothing")), 7);
        let nan = from_text(&good.replace("0 1 0", "0 NaN 0"));
        assert_eq!(nan, Err(MeshError::NotFinite { vertex: 2 }));
        let index = from_text(&good.replace("3 0 1 2", "3 0 1 7"));
        assert_eq!(index, Err(MeshError::Index { triangle: 0, found: 7, n_vertices: 3 }));
    }

    #[test]
    fn excessive_counts_are_refused_before_allocating() {
        let error = from_text("OFF\n1000000 1000000 0\n0 0 0\n").unwrap_err();
        assert!(matches!(error, MeshError::Truncated { .. }), "{error}");
        let error = from_text("OFF\n3 99999999999 0\n").unwrap_err();
        assert!(matches!(error, MeshError::TooMany { found: 99_999_999_999, .. }), "{error}");
    }
}
