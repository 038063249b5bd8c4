//! STL through `stl_io`: triangle by triangle, their count checked against the bytes first.
//!
//! A binary file whose comment begins with "solid" is recognised as binary by its length.

use std::io::Cursor;

use glam::DVec3;

use super::format::Soup;
use super::{MeshError, MeshFormat, TRIANGLES_MAX, check_count};

const FORMAT: MeshFormat = MeshFormat::Stl;
const HEADER_BYTES: usize = 84;
const TRIANGLE_BYTES: usize = 50;

pub(super) fn read(bytes: &[u8]) -> Result<Soup, MeshError> {
    let says_solid = bytes.starts_with(b"solid");
    match binary_count(bytes) {
        Some(n) if bytes.len() == HEADER_BYTES + n * TRIANGLE_BYTES && says_solid => {
            // The reader judges by the first word, so the comment is replaced.
            read_triangles(&[b"binary", &bytes[6..]].concat())
        }
        _ if says_solid && !bytes.starts_with(b"solid ") => {
            // "solid" without a name, which the reader does not accept.
            read_triangles(&[b"solid ", &bytes[5..]].concat())
        }
        _ if says_solid => read_triangles(bytes),
        Some(n) => {
            check_count("triangles", n, TRIANGLES_MAX)?;
            let expected = HEADER_BYTES + n * TRIANGLE_BYTES;
            if bytes.len() < expected {
                let found = bytes.len();
                return Err(MeshError::Truncated { format: FORMAT, found, expected });
            }
            read_triangles(bytes)
        }
        None => {
            let found = bytes.len();
            Err(MeshError::Truncated { format: FORMAT, found, expected: HEADER_BYTES })
        }
    }
}

/// The count of a binary file's header.
fn binary_count(bytes: &[u8]) -> Option<usize> {
    let field = bytes.get(HEADER_BYTES - 4..HEADER_BYTES)?.try_into().ok()?;
    Some(u32::from_le_bytes(field) as usize)
}

fn read_triangles(bytes: &[u8]) -> Result<Soup, MeshError> {
    let unreadable = |_| MeshError::Unreadable { format: FORMAT };
    let mut cursor = Cursor::new(bytes);
    let reader = stl_io::create_stl_reader(&mut cursor).map_err(unreadable)?;
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for triangle in reader {
        let triangle = triangle.map_err(unreadable)?;
        check_count("triangles", triangles.len() + 1, TRIANGLES_MAX)?;
        let first = vertices.len() as u32;
        triangles.push([first, first + 1, first + 2]);
        vertices.extend(triangle.vertices.map(|corner| {
            let [x, y, z] = corner.0.map(f64::from);
            DVec3::new(x, y, z)
        }));
    }
    Ok((vertices, triangles))
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
    }

    #[test]
    fn a_nameless_ascii_file_is_read() {
        let mesh = Mesh::from_bytes(FORMAT, ASCII.as_bytes(), 1e-3).unwrap();
        assert!((mesh.surface_area() - 0.5e-6).abs() < 1e-15);
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
        let cut = ASCII.replace("vertex 0 1 0\n", "");
        assert_eq!(read(cut.as_bytes()), MeshError::Unreadable { format: FORMAT });
        let infinite = ASCII.replace("1 0 0", "1e99 0 0");
        assert_eq!(read(infinite.as_bytes()), MeshError::Unreadable { format: FORMAT });
    }
}
