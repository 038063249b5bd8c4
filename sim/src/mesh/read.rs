//! The one entry to the readers of mesh files.
//!
//! Uploads are hostile: counts are checked against the bytes before anything is allocated, and a
//! panic inside a third-party reader becomes an error. Below the text formats is `text`, above all
//! formats is `assemble`.

use std::borrow::Cow;
use std::panic::{AssertUnwindSafe, catch_unwind};

use super::assemble::assemble;
use super::format::other_content;
use super::polygons::Polygons;
use super::{Mesh, MeshError, MeshFormat, MeshRemark, glb, obj, off, ply, stl, text, three_mf};

/// Bytes behind the end of a file that cannot hold a triangle in any format: padding.
const PADDING_BYTES: usize = 50;

/// A mesh as it was read from a file.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshFile {
    /// The mesh.
    pub mesh: Mesh,
    /// Metres in one unit of the file.
    pub unit: f64,
    /// What a person should look at before training.
    pub remarks: Vec<MeshRemark>,
}

impl Mesh {
    /// Reads a mesh from a file's bytes; one unit of the file is `unit` metres (0.001 for a
    /// file in millimetres). A format that records its unit is read by that.
    ///
    /// # Errors
    /// [`MeshError`] when the bytes are not of that format, contradict their own counts, or
    /// do not make a mesh (see [`Mesh::new`]).
    pub fn from_bytes(format: MeshFormat, bytes: &[u8], unit: f64) -> Result<Self, MeshError> {
        let unit = Some(unit).filter(|_| !format.knows_its_unit());
        Ok(Self::read(format, bytes, unit)?.mesh)
    }

    /// Reads a mesh file, with its unit and what is remarkable about it.
    ///
    /// All solids, groups and objects of the file are one body. Polygons are cut into triangles in
    /// their own plane; vertices at the same place become one, and unused ones none.
    ///
    /// # Errors
    /// As [`Mesh::from_bytes`]; when the format does not record its unit and `unit` is missing, or
    /// when both are there and contradict each other.
    pub fn read(
        format: MeshFormat,
        bytes: &[u8],
        unit: Option<f64>,
    ) -> Result<MeshFile, MeshError> {
        if let Some(found) = unit.filter(|unit| !(1e-9..=1e6).contains(unit)) {
            return Err(MeshError::Unit { found });
        }
        let (polygons, recorded) = parse(format, bytes)?;
        let unit = match (unit, recorded) {
            (Some(found), Some(recorded)) if (found / recorded - 1.0).abs() > 1e-9 => {
                return Err(MeshError::UnitContradicts { found, recorded });
            }
            (given, recorded) => recorded.or(given).ok_or(MeshError::UnitMissing { format })?,
        };
        let (vertices, triangles, mut remarks) = assemble(polygons, unit)?;
        let mesh = Self::new(vertices, triangles)?;
        remarks.extend(mesh.remarks(unit));
        Ok(MeshFile { mesh, unit, remarks })
    }
}

/// Parses a file's bytes; lengths stay in the file's unit, which comes beside them if the file
/// records it.
fn parse(format: MeshFormat, bytes: &[u8]) -> Result<(Polygons, Option<f64>), MeshError> {
    if bytes.is_empty() {
        return Err(MeshError::Empty);
    }
    let read = catch_unwind(AssertUnwindSafe(|| read_all(format, bytes)));
    let read = read.unwrap_or(Err(MeshError::Unreadable { format }));
    // Some formats skip unknown lines, and find nothing in a file of another format.
    let read =
        read.and_then(|read| if read.0.len() == 0 { Err(MeshError::Empty) } else { Ok(read) });
    // A comment of a binary STL may begin with anything, so only failures are checked.
    read.map_err(|error| match MeshFormat::from_content(bytes) {
        Some(found) if found != format => MeshError::OtherFormat { format, found },
        Some(_) => error,
        None => match other_content(bytes) {
            Some(found) => MeshError::OtherContent { format, found },
            None => error,
        },
    })
}

/// Reads object after object to the end of the file.
fn read_all(format: MeshFormat, bytes: &[u8]) -> Result<(Polygons, Option<f64>), MeshError> {
    let mut polygons = Polygons::default();
    let is_text = match format {
        MeshFormat::Stl => stl::is_text(bytes),
        MeshFormat::Ply => ply::is_text(bytes),
        MeshFormat::Obj | MeshFormat::Off => true,
        MeshFormat::Glb | MeshFormat::ThreeMf => false,
    };
    let bytes = if is_text { Cow::Owned(text::plain(bytes)) } else { Cow::Borrowed(bytes) };
    let mut recorded = None;
    let mut rest = &bytes[..];
    loop {
        let n_before = polygons.len();
        let is_first = rest.len() == bytes.len();
        let read = match format {
            MeshFormat::Stl => stl::read(rest, &mut polygons),
            MeshFormat::Obj => obj::read(rest, &mut polygons),
            MeshFormat::Ply => ply::read(rest, &mut polygons),
            MeshFormat::Off => off::read(rest, &mut polygons),
            MeshFormat::Glb => glb::read(rest, &mut polygons),
            MeshFormat::ThreeMf => three_mf::read(rest, &mut polygons).map(|unit| {
                recorded = Some(unit);
                &rest[rest.len()..]
            }),
        };
        let left = MeshError::Left { format, bytes: rest.len() };
        // What follows an object is another one, or nothing.
        let behind = if is_first { read? } else { read.map_err(|_| left.clone())? };
        polygons.end_object()?;
        if !is_first && polygons.len() == n_before {
            return Err(left);
        }
        let is_nothing = |byte: &u8| *byte == 0 || byte.is_ascii_whitespace();
        let is_padding = !is_text && behind.len() < PADDING_BYTES;
        if is_padding || behind.iter().all(is_nothing) {
            break;
        }
        rest = behind;
    }
    if format == MeshFormat::Glb {
        recorded = Some(1.0);
    }
    Ok((polygons, recorded))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn empty_files_and_units_out_of_range_are_refused() {
        for format in MeshFormat::ALL {
            assert_eq!(Mesh::from_bytes(format, b"", 1.0), Err(MeshError::Empty), "{format}");
            for unit in [0.0, -1.0, f64::NAN, f64::INFINITY] {
                let error = Mesh::read(format, b"x", Some(unit)).unwrap_err();
                assert!(matches!(error, MeshError::Unit { .. }));
            }
        }
    }

    #[test]
    fn the_first_word_reveals_another_format() {
        let wide: Vec<u8> =
            "v 0 0 0\nf 1 1 1\n".encode_utf16().flat_map(u16::to_le_bytes).collect();
        let files: [(MeshFormat, &[u8]); 9] = [
            (MeshFormat::Obj, b"# Blender v3.6.2\n# www.blender.org\no Cube\nv 0 0 0\n"),
            (MeshFormat::Ply, b"#\r\rply\rformat ascii 1.0\rend_header\r"),
            (MeshFormat::Obj, &wide),
            (MeshFormat::Off, b"STCNOFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"),
            (MeshFormat::Ply, b"ply\nformat ascii 1.0\nend_header\n"),
            (MeshFormat::Stl, b"SOLID cube\nendsolid cube\n"),
            (MeshFormat::Obj, b"\xef\xbb\xbfv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
            (MeshFormat::Glb, b"glTF\x02\0\0\0"),
            (MeshFormat::ThreeMf, b"PK\x03\x04 3D/3dmodel.model"),
        ];
        for (found, file) in files {
            for format in MeshFormat::ALL.into_iter().filter(|format| *format != found) {
                // Long enough for a binary STL's header, whose count is then nonsense.
                let file = file.repeat(40);
                let refused = Mesh::from_bytes(format, &file, 1e-3);
                assert_eq!(refused, Err(MeshError::OtherFormat { format, found }));
            }
        }
    }

    #[test]
    fn files_that_are_no_mesh_are_named() {
        let files: [(&[u8], &str); 6] = [
            (b"PK\x03\x04\x14\0\0\0\x08\0mug.stl", "a ZIP archive"),
            (b"ISO-10303-21;\nHEADER;\n", "STEP"),
            (b"{\"asset\":{\"version\":\"2.0\"}}", "export GLB"),
            (b"<?xml version=\"1.0\"?><COLLADA/>", "XML"),
            (b"<!DOCTYPE html><html>not found</html>", "a web page"),
            (b"version https://git-lfs.github.com/spec/v1\n", "git lfs pull"),
        ];
        for (file, expected) in files {
            for format in MeshFormat::ALL {
                let error = Mesh::from_bytes(format, &file.repeat(40), 1e-3).unwrap_err();
                assert!(error.to_string().contains(expected), "{format}: {error}");
            }
        }
    }

    proptest::proptest! {
        #[test]
        fn any_bytes_are_read_or_refused(
            bytes in proptest::collection::vec(proptest::num::u8::ANY, 0..400),
            which in 0..6usize,
            head in 0..6usize,
        ) {
            let heads: [&[u8]; 6] = [
                b"", b"solid x\n", b"OFF\n", b"ply\nformat ascii 1.0\nelement vertex 3\n",
                b"glTF\x02\0\0\0\x40\0\0\0\x20\0\0\0JSON{\"asset\":{\"version\":\"2.0\"},",
                b"PK\x03\x043D/3dmodel.model",
            ];
            let file = [heads[head], &bytes].concat();
            let _ = Mesh::from_bytes(MeshFormat::ALL[which], &file, 1e-3);
        }
    }
}
