//! PLY through `ply-rs-bw`: the elements `vertex` and `face`, other elements skipped.
//!
//! The header is read first and every count checked against the remaining bytes.

use glam::DVec3;
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{
    ElementDef, Encoding, Header, Property, PropertyAccess, PropertyAccessResult, PropertyType,
    ScalarType,
};

use super::format::{Soup, push_fan};
use super::{MeshError, MeshFormat, TRIANGLES_MAX, VERTICES_MAX, check_count};

const FORMAT: MeshFormat = MeshFormat::Ply;

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

pub(super) fn read(bytes: &[u8]) -> Result<Soup, MeshError> {
    let mut reader = Reader::new(bytes);
    let parser = Parser::<Element>::new();
    let refused = |error: ply_rs_bw::parser::ParseError| match error.line() {
        Some(line) => MeshError::Syntax { format: FORMAT, line, expected: "valid PLY" },
        None => MeshError::Unreadable { format: FORMAT },
    };
    let header = parser.read_header(&mut reader).map_err(refused)?;
    check_header(&header, bytes.len())?;
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for element in header.elements.values() {
        let values =
            parser.read_payload_for_element(&mut reader, element, &header).map_err(refused)?;
        match element.name.as_str() {
            "vertex" => {
                vertices = values.iter().map(|value| DVec3::from_array(value.position)).collect();
            }
            "face" => {
                for (polygon, value) in values.iter().enumerate() {
                    let n_vertices = vertices.len();
                    if !value.corners_fit {
                        return Err(MeshError::Index { triangle: polygon, found: -1, n_vertices });
                    }
                    push_fan(&mut triangles, &value.corners, polygon, n_vertices)?;
                }
            }
            _ => {}
        }
    }
    Ok((vertices, triangles))
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
