//! The OFF parser: a header, counts, vertices, polygons, all as words.
//!
//! Reads `OFF`, `COFF` and `NOFF` with counts on the same or the next line. Anything after
//! the coordinates or corners on a line (colours, normals) is ignored, as are comments.

use glam::DVec3;

use super::format::{Soup, push_fan};
use super::{MeshError, MeshFormat, TRIANGLES_MAX, VERTICES_MAX, check_count};

const FORMAT: MeshFormat = MeshFormat::Off;
/// The shortest vertex, "0 0 0" and a line's end, and the shortest polygon, "3 0 1 2".
const VERTEX_BYTES_MIN: usize = 6;
const POLYGON_BYTES_MIN: usize = 2;

/// Lines with content, and their numbers.
struct Lines<'a> {
    lines: std::iter::Enumerate<std::str::Lines<'a>>,
    line: usize,
}

impl<'a> Lines<'a> {
    fn next(&mut self, expected: &'static str) -> Result<&'a str, MeshError> {
        for (idx, text) in self.lines.by_ref() {
            self.line = idx + 1;
            let text = text.split('#').next().unwrap_or_default().trim();
            if !text.is_empty() {
                return Ok(text);
            }
        }
        self.line += 1;
        Err(self.fault(expected))
    }

    fn fault(&self, expected: &'static str) -> MeshError {
        MeshError::Syntax { format: FORMAT, line: self.line, expected }
    }
}

pub(super) fn read(bytes: &[u8]) -> Result<Soup, MeshError> {
    let text = std::str::from_utf8(bytes).map_err(|_| MeshError::Unreadable { format: FORMAT })?;
    let mut lines = Lines { lines: text.lines().enumerate(), line: 0 };
    let [n_vertices, n_polygons] = read_counts(&mut lines)?;
    check_count("vertices", n_vertices, VERTICES_MAX)?;
    check_count("polygons", n_polygons, TRIANGLES_MAX)?;
    let expected = n_vertices * VERTEX_BYTES_MIN + n_polygons * POLYGON_BYTES_MIN;
    if bytes.len() < expected {
        return Err(MeshError::Truncated { format: FORMAT, found: bytes.len(), expected });
    }
    let mut vertices = Vec::with_capacity(n_vertices);
    for _ in 0..n_vertices {
        let line = lines.next("a vertex of three numbers")?;
        vertices.push(vertex(line).ok_or_else(|| lines.fault("a vertex of three numbers"))?);
    }
    let mut triangles = Vec::with_capacity(n_polygons);
    let mut corners = Vec::new();
    for polygon in 0..n_polygons {
        let line = lines.next("a polygon: a count and as many vertices")?;
        if !read_polygon(line, &mut corners) {
            return Err(lines.fault("a polygon: a count and as many vertices"));
        }
        push_fan(&mut triangles, &corners, polygon, n_vertices)?;
    }
    Ok((vertices, triangles))
}

fn read_counts(lines: &mut Lines<'_>) -> Result<[usize; 2], MeshError> {
    let first = lines.next("the word OFF")?;
    let rest = ["COFF", "NOFF", "OFF"].iter().find_map(|word| first.strip_prefix(word));
    let rest = rest.ok_or_else(|| lines.fault("the word OFF"))?.trim();
    let expected = "counts of vertices, polygons and edges";
    let counts = if rest.is_empty() { lines.next(expected)? } else { rest };
    let mut words = counts.split_whitespace().map(str::parse);
    match (words.next(), words.next()) {
        (Some(Ok(n_vertices)), Some(Ok(n_polygons))) => Ok([n_vertices, n_polygons]),
        _ => Err(lines.fault(expected)),
    }
}

fn vertex(line: &str) -> Option<DVec3> {
    let mut words = line.split_whitespace().map(|word| word.parse().ok());
    Some(DVec3::new(words.next()??, words.next()??, words.next()??))
}

/// Reads "n i₁ … iₙ" into `corners`; false if the line has another form.
fn read_polygon(line: &str, corners: &mut Vec<u32>) -> bool {
    corners.clear();
    let mut words = line.split_whitespace();
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
        assert_eq!(syntax("PLY\n"), 1);
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
