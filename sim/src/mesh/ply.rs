//! PLY through `ply-rs-bw`: the elements `vertex` and `face`, other elements skipped.
//!
//! The header is read first and every count checked against the remaining bytes. Decimal
//! numbers are read in double precision, whatever type the header gives them.

use std::io::BufRead as _;

use glam::DVec3;
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{
    ElementDef, Encoding, Header, Property, PropertyAccess, PropertyAccessResult, PropertyType,
    ScalarType,
};

use super::polygons::{Polygons, check_count};
use super::text::{self, Lines};
use super::{MeshError, MeshFormat, TRIANGLES_MAX, VERTICES_MAX};

const FORMAT: MeshFormat = MeshFormat::Ply;
/// Bytes in which a header says whether the file is ASCII, and in which it ends.
const HEAD_BYTES: usize = 65_536;

/// The used properties of any element: coordinates, and corners if it has them.
struct Element {
    position: [f64; 3],
    corners: Vec<u32>,
    corners_fit: bool,
}

impl PropertyAccess for Element {
    fn new() -> Self {
        Self { position: [f64::NAN; 3], corners: Vec::new(), corners_fit: true }
    }

    fn set_property(&mut self, name: &str, value: Property) -> PropertyAccessResult {
        if let Some(axis) = ["x", "y", "z"].iter().position(|axis| *axis == name) {
            self.position[axis] = scalar(&value);
        } else if name == "vertex_indices" || name == "vertex_index" {
            match value.to_u32_list() {
                Some(corners) => self.corners = corners,
                None => self.corners_fit = false,
            }
        }
        PropertyAccessResult::Set
    }
}

fn scalar(value: &Property) -> f64 {
    match *value {
        Property::Char(v) => f64::from(v),
        Property::UChar(v) => f64::from(v),
        Property::Short(v) => f64::from(v),
        Property::UShort(v) => f64::from(v),
        Property::Int(v) => f64::from(v),
        Property::UInt(v) => f64::from(v),
        Property::Float(v) => f64::from(v),
        Property::Double(v) => v,
        _ => f64::NAN,
    }
}

/// Whether a file is ASCII, by its header.
pub(super) fn is_text(bytes: &[u8]) -> bool {
    let head = text::plain(&bytes[..bytes.len().min(HEAD_BYTES)]);
    let mut lines = head.split(|byte| *byte == b'\n');
    lines.any(|line| {
        let words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
        let begins: Vec<Vec<u8>> = words.take(2).map(<[u8]>::to_ascii_lowercase).collect();
        begins == [b"format", &b"ascii"[..]]
    })
}

/// Reads one object, binary or plain text; returns what follows.
pub(super) fn read<'a>(bytes: &'a [u8], polygons: &mut Polygons) -> Result<&'a [u8], MeshError> {
    let (head, body) = split(bytes)?;
    let parser = Parser::<Element>::new();
    let header =
        parser.read_header(&mut Reader::new(&head[..])).map_err(|error| refused(&error))?;
    check_header(&header, body.len())?;
    let before = &bytes[..bytes.len() - body.len()];
    let n_lines = before.iter().filter(|byte| **byte == b'\n').count();
    let mut lines = Lines { rest: body, line: n_lines };
    for element in header.elements.values() {
        for number in 0..element.count {
            let read = match header.encoding {
                Encoding::Ascii => {
                    let Some((_, line)) = lines.find(|(_, line)| !line.is_empty()) else {
                        let expected = "as many elements as the header says";
                        return Err(MeshError::Syntax {
                            format: FORMAT,
                            line: lines.line,
                            expected,
                        });
                    };
                    parser.read_ascii_element(line, element)
                }
                Encoding::BinaryBigEndian => {
                    parser.read_big_endian_element(&mut lines.rest, element)
                }
                Encoding::BinaryLittleEndian => {
                    parser.read_little_endian_element(&mut lines.rest, element)
                }
            };
            let read = read.map_err(|_| match header.encoding {
                Encoding::Ascii => {
                    let expected = "the numbers of its element, by the header";
                    MeshError::Syntax { format: FORMAT, line: lines.line, expected }
                }
                _ => MeshError::Unreadable { format: FORMAT },
            })?;
            match element.name.as_str() {
                "vertex" => polygons.vertex(DVec3::from_array(read.position))?,
                "face" if read.corners_fit => polygons.polygon(&read.corners)?,
                "face" => {
                    let n_vertices = polygons.n_vertices();
                    return Err(MeshError::Index { triangle: number, found: -1, n_vertices });
                }
                _ => {}
            }
        }
    }
    Ok(lines.rest)
}

/// The header as the reader knows it, and what follows it.
fn split(bytes: &[u8]) -> Result<(Vec<u8>, &[u8]), MeshError> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).trim_ascii_start();
    let window = &bytes[..bytes.len().min(HEAD_BYTES)];
    let word = b"end_header";
    let end = window.windows(word.len()).position(|part| part.eq_ignore_ascii_case(word));
    let expected = "a header with an end";
    let end = end.ok_or(MeshError::Syntax { format: FORMAT, line: 1, expected })? + word.len();
    // All lines of a header end alike, and a first byte of the body may look like a line's end.
    let line_end = match window.iter().position(|byte| matches!(byte, b'\r' | b'\n')) {
        Some(at) if window[at..].starts_with(b"\r\n") => 2,
        _ => 1,
    };
    let body = bytes.get(end + line_end..).unwrap_or_default();
    let plain = text::plain(&bytes[..end]).to_ascii_lowercase();
    let is_ascii = is_text(&plain);
    let mut head = Vec::new();
    for line in plain.lines() {
        let line = line.map_err(|_| MeshError::Unreadable { format: FORMAT })?;
        let mut words: Vec<&str> = line.split_ascii_whitespace().collect();
        if words.is_empty() {
            continue;
        }
        if is_ascii && words.first() == Some(&"property") {
            for word in &mut words[1..] {
                if matches!(*word, "float" | "float32") {
                    *word = "double";
                }
            }
        }
        head.extend(words.join(" ").bytes().chain([b'\n']));
    }
    Ok((head, body))
}

fn refused(error: &ply_rs_bw::parser::ParseError) -> MeshError {
    match error.line() {
        Some(line) => MeshError::Syntax { format: FORMAT, line, expected: "valid PLY" },
        None => MeshError::Unreadable { format: FORMAT },
    }
}

/// Refuses counts that are over the limits or need more bytes than the file has.
fn check_header(header: &Header, found: usize) -> Result<(), MeshError> {
    let mut expected = 0usize;
    for element in header.elements.values() {
        let (what, max) = match element.name.as_str() {
            "vertex" => ("vertices", VERTICES_MAX),
            "face" => ("polygons", TRIANGLES_MAX),
            _ => ("other elements", VERTICES_MAX),
        };
        check_count(what, element.count, max)?;
        expected += element.count * element_bytes_min(element, header.encoding);
    }
    if found < expected {
        return Err(MeshError::Truncated { format: FORMAT, found, expected });
    }
    Ok(())
}

/// Minimum bytes of an element; an element without properties counts as one byte.
fn element_bytes_min(element: &ElementDef, encoding: Encoding) -> usize {
    let property_bytes = |data_type: &PropertyType| match (encoding, data_type) {
        (Encoding::Ascii, _) => 2, // a digit and a blank
        (_, PropertyType::Scalar(scalar) | PropertyType::List(scalar, _)) => match scalar {
            ScalarType::Char | ScalarType::UChar => 1,
            ScalarType::Short | ScalarType::UShort => 2,
            ScalarType::Int | ScalarType::UInt | ScalarType::Float => 4,
            ScalarType::Double => 8,
        },
    };
    let bytes: usize = element.properties.values().map(|p| property_bytes(&p.data_type)).sum();
    bytes.max(1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Mesh;

    const HEADER: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\n\
        property float y\nproperty float z\nelement face 1\n\
        property list uchar int vertex_indices\nend_header\n";
    const BODY: &str = "0 0 0\n10 0 0\n10 10 0\n0 10 0\n4 0 1 2 3\n";

    fn read(text: &str) -> Result<Mesh, MeshError> {
        Mesh::from_bytes(FORMAT, text.as_bytes(), 1e-3)
    }

    fn binary() -> Vec<u8> {
        let mut bytes = HEADER.replace("ascii", "binary_little_endian").into_bytes();
        for value in [0.0f32, 0.0, 0.0, 10.0, 0.0, 0.0, 10.0, 10.0, 0.0, 0.0, 10.0, 0.0] {
            bytes.extend(value.to_le_bytes());
        }
        bytes.push(4);
        bytes.extend([0i32, 1, 2, 3].map(i32::to_le_bytes).concat());
        bytes
    }

    #[test]
    fn ascii_and_binary_give_the_same_square() {
        let ascii = read(&format!("{HEADER}{BODY}")).unwrap();
        assert_eq!(ascii.triangles(), [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(Mesh::from_bytes(FORMAT, &binary(), 1e-3).unwrap(), ascii);
    }

    #[test]
    fn bad_files_are_refused() {
        assert!(read("ply\nformat ascii 1.0\n").is_err());
        let body = |from: &str, to: &str| read(&format!("{HEADER}{}", BODY.replace(from, to)));
        assert!(matches!(body("10 0 0\n", "10 0\n"), Err(MeshError::Syntax { .. })));
        assert!(matches!(body("10 10 0", "nan 10 0"), Err(MeshError::Syntax { .. })));
        for (corners, found) in [("4 0 1 2 9", 9), ("4 0 1 2 -1", -1)] {
            let expected = MeshError::Index { triangle: 0, found, n_vertices: 4 };
            assert_eq!(body("4 0 1 2 3", corners), Err(expected));
        }
        assert!(body("4 0 1 2 3\n", "").is_err());
        let mut bytes = binary();
        assert!(Mesh::from_bytes(FORMAT, &bytes[..bytes.len() - 3], 1e-3).is_err());
        let second_vertex = bytes.len() - 17 - 36;
        bytes[second_vertex..second_vertex + 4].copy_from_slice(&f32::NAN.to_le_bytes());
        let nan = Mesh::from_bytes(FORMAT, &bytes, 1e-3);
        assert_eq!(nan, Err(MeshError::NotFinite { vertex: 1 }));
    }

    #[test]
    fn excessive_counts_are_refused_before_allocating() {
        let counted = |n: &str| HEADER.replace("vertex 4", &format!("vertex {n}"));
        assert!(matches!(read(&counted("5000000")), Err(MeshError::Truncated { .. })));
        assert!(matches!(read(&counted("99999999999999")), Err(MeshError::TooMany { .. })));
        let empty = "ply\nformat binary_little_endian 1.0\nelement nothing 5000000\nend_header\n";
        assert!(matches!(read(empty), Err(MeshError::Truncated { .. })));
    }
}
