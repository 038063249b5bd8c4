//! STL, binary or ASCII, one solid at a time.
//!
//! A binary file's count is checked against its bytes first. Its header has a zero byte in the
//! count, which text has not: a binary comment may begin with "solid". Normals are not read.

use glam::{DVec3, Vec3};

use super::polygons::{Polygons, check_count};
use super::text::{Lines, numbers};
use super::{MeshError, MeshFormat, TRIANGLES_MAX, text};

const FORMAT: MeshFormat = MeshFormat::Stl;
const HEADER_BYTES: usize = 84;
const TRIANGLE_BYTES: usize = 50;

/// Whether a file is ASCII: it begins with the word "solid" and has no zero byte.
pub(super) fn is_text(bytes: &[u8]) -> bool {
    let is_wide = matches!(bytes, [0xff, 0xfe, ..] | [0xfe, 0xff, ..] | [_, 0, ..] | [0, ..]);
    let has_zero = bytes[..bytes.len().min(HEADER_BYTES)].contains(&0);
    let head = text::plain(&bytes[..bytes.len().min(3 * HEADER_BYTES)]);
    let word = head.trim_ascii_start().get(..5);
    word.is_some_and(|word| word.eq_ignore_ascii_case(b"solid")) && (is_wide || !has_zero)
}

/// Reads one binary file, or all solids of plain text; returns what follows.
pub(super) fn read<'a>(bytes: &'a [u8], polygons: &mut Polygons) -> Result<&'a [u8], MeshError> {
    if is_text(bytes) { read_text(bytes, polygons) } else { read_binary(bytes, polygons) }
}

fn read_binary<'a>(bytes: &'a [u8], polygons: &mut Polygons) -> Result<&'a [u8], MeshError> {
    let found = bytes.len();
    let truncated = |expected| MeshError::Truncated { format: FORMAT, found, expected };
    let count = bytes.get(HEADER_BYTES - 4..HEADER_BYTES).ok_or(truncated(HEADER_BYTES))?;
    let n = u32::from_le_bytes([count[0], count[1], count[2], count[3]]) as usize;
    check_count("triangles", n, TRIANGLES_MAX)?;
    let end = HEADER_BYTES + n * TRIANGLE_BYTES;
    let triangles = bytes.get(HEADER_BYTES..end).ok_or(truncated(end))?;
    for triangle in triangles.chunks_exact(TRIANGLE_BYTES) {
        let number = |at: usize| {
            let bytes = &triangle[4 * at..4 * at + 4];
            f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])
        };
        // The first three are the normal.
        for at in [3, 6, 9] {
            let corner = Vec3::new(number(at), number(at + 1), number(at + 2));
            polygons.vertex(corner.as_dvec3())?;
        }
        let first = polygons.n_vertices() as u32 - 3;
        polygons.polygon(&[first, first + 1, first + 2])?;
    }
    Ok(&bytes[end..])
}

/// Reads facets, whatever solids they are in; a line may end between any two words.
fn read_text<'a>(text: &'a [u8], polygons: &mut Polygons) -> Result<&'a [u8], MeshError> {
    let in_lines = Lines::of(text);
    let numbered = |(line, words): (usize, &'a str)| {
        words.split_ascii_whitespace().map(move |word| (line, word))
    };
    let mut words = in_lines.flat_map(numbered).peekable();
    let mut corners = Vec::new();
    let mut in_loop = false;
    let mut last = 0;
    while let Some((line, word)) = words.next() {
        let fault = |expected| MeshError::Syntax { format: FORMAT, line, expected };
        last = line;
        match word.to_ascii_lowercase().as_str() {
            // The rest of the line is a name.
            "solid" | "endsolid" if !in_loop => {
                while words.next_if(|(of, _)| *of == line).is_some() {}
            }
            "facet" if !in_loop => {
                let normal: [&str; 4] =
                    std::array::from_fn(|_| words.next().map_or("outer", |(_, word)| word));
                if normal.iter().any(|word| word.eq_ignore_ascii_case("outer")) {
                    return Err(fault("a normal of three numbers"));
                }
            }
            "outer" if !in_loop => {
                in_loop = words.next().is_some_and(|(_, word)| word.eq_ignore_ascii_case("loop"));
                if !in_loop {
                    return Err(fault("the word loop"));
                }
            }
            "vertex" if in_loop => {
                let place = numbers::<3>(&mut words.by_ref().map(|(_, word)| word))
                    .ok_or(fault("a vertex of three numbers such as 1.5, with a point"))?;
                corners.push(polygons.n_vertices() as u32);
                polygons.vertex(DVec3::from_array(place))?;
            }
            "endloop" if in_loop => {
                if corners.len() < 3 {
                    return Err(fault("three vertices before the loop's end"));
                }
                polygons.polygon(&corners)?;
                corners.clear();
                in_loop = false;
            }
            "endfacet" if !in_loop => {}
            _ => return Err(fault("solid, facet, outer loop, vertex or an end of them")),
        }
    }
    let expected = "the end of a facet before that of the file";
    if in_loop {
        return Err(MeshError::Syntax { format: FORMAT, line: last, expected });
    }
    Ok(&text[text.len()..])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Mesh;

    fn tetrahedron() -> Mesh {
        let vertices = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        Mesh::new(vertices, vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]).unwrap()
    }

    const ASCII: &str = "solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n\
                         vertex 0 1 0\nendloop\nendfacet\nendsolid\n";

    #[test]
    fn a_binary_file_is_welded_even_when_it_says_solid() {
        let mut bytes = tetrahedron().to_stl_bytes();
        let read = |bytes: &[u8]| Mesh::from_bytes(FORMAT, bytes, 1.0);
        assert!(read(&bytes).unwrap().is_watertight());
        bytes[..6].copy_from_slice(b"solid ");
        assert_eq!(read(&bytes).unwrap().vertices().len(), 4);
        // Padding behind the last triangle changes nothing.
        bytes.extend([0; 60]);
        assert_eq!(read(&bytes).unwrap().vertices().len(), 4);
    }

    #[test]
    fn a_nameless_ascii_file_is_read() {
        let mesh = Mesh::from_bytes(FORMAT, ASCII.as_bytes(), 1e-3).unwrap();
        assert!((mesh.surface_area() - 0.5e-6).abs() < 1e-15);
    }

    #[test]
    fn a_line_may_end_between_any_two_words() {
        let broken = ASCII.replacen("solid", "solid a name\n", 1).replace("normal ", "\nnormal\n");
        let broken = broken.replace("outer loop", "outer\nloop").replace(" 0 0", "\n0\n0");
        let mesh = Mesh::from_bytes(FORMAT, broken.as_bytes(), 1e-3).unwrap();
        assert!((mesh.surface_area() - 0.5e-6).abs() < 1e-15);
        let joined =
            ASCII.replacen('\n', " a name\n", 1).replace("\nv", " v").replace("\nend", " end");
        assert!(Mesh::from_bytes(FORMAT, joined.as_bytes(), 1e-3).is_ok());
    }

    #[test]
    fn bad_files_are_refused() {
        let good = tetrahedron().to_stl_bytes();
        let read = |bytes: &[u8]| Mesh::from_bytes(FORMAT, bytes, 1.0).unwrap_err();
        assert!(matches!(read(&good[..70]), MeshError::Truncated { expected: 84, .. }));
        assert!(matches!(read(&good[..200]), MeshError::Truncated { expected: 284, .. }));
        let mut huge = good.clone();
        huge[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
        assert!(matches!(read(&huge), MeshError::TooMany { .. }));
        let mut nan = good;
        nan[96..100].copy_from_slice(&f32::NAN.to_le_bytes());
        assert_eq!(read(&nan), MeshError::NotFinite { vertex: 0 });
        assert_eq!(read(b"solid x\nendsolid x\n"), MeshError::Empty);
        let line = |from: &str, to: &str| match read(ASCII.replace(from, to).as_bytes()) {
            MeshError::Syntax { line, .. } => line,
            other => panic!("{other:?}"),
        };
        assert_eq!(line("vertex 0 1 0\n", ""), 6);
        assert_eq!(line("vertex 0 1 0", "vertex 0 1,5 0"), 6);
        assert_eq!(line("normal 0 0 1", "normal 0 0"), 2);
        assert_eq!(line("endsolid", "garbage"), 9);
        assert_eq!(line("endloop\nendfacet\nendsolid\n", ""), 6);
        let infinite = ASCII.replace("1 0 0", "1e999 0 0");
        assert_eq!(read(infinite.as_bytes()), MeshError::NotFinite { vertex: 1 });
    }
}
