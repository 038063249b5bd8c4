//! The supported mesh formats, and the one entry to their parsers.
//!
//! Uploads are hostile: counts are checked against the bytes before anything is allocated,
//! and a panic inside a third-party reader becomes an error.

use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};

use glam::DVec3;

use super::{MeshError, obj, off, ply, stl};

/// Vertices in the file's unit, and triangles whose indices may still be out of range.
pub(super) type Soup = (Vec<DVec3>, Vec<[u32; 3]>);

/// A mesh file format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeshFormat {
    /// Stereolithography, binary or ASCII.
    Stl,
    /// Wavefront OBJ.
    Obj,
    /// Polygon file format, ASCII or binary.
    Ply,
    /// Object file format of Geomview, ASCII.
    Off,
}

/// Each format with its name, which is also its extension, and its media type.
const FORMATS: [(MeshFormat, &str, &str); 4] = [
    (MeshFormat::Stl, "STL", "model/stl"),
    (MeshFormat::Obj, "OBJ", "model/obj"),
    (MeshFormat::Ply, "PLY", "model/ply"),
    (MeshFormat::Off, "OFF", "model/off"),
];

impl MeshFormat {
    /// The format of a file name's extension, with or without its dot, in any case.
    #[must_use]
    pub fn from_extension(extension: &str) -> Option<Self> {
        let extension = extension.trim_start_matches('.');
        let found = FORMATS.iter().find(|(_, name, _)| name.eq_ignore_ascii_case(extension));
        found.map(|(format, ..)| *format)
    }

    /// The format of a media type such as `model/stl`; parameters after `;` are ignored.
    #[must_use]
    pub fn from_media_type(media_type: &str) -> Option<Self> {
        let essence = media_type.split(';').next().unwrap_or_default().trim();
        match essence.to_ascii_lowercase().as_str() {
            "model/stl" | "model/x.stl-binary" | "model/x.stl-ascii" | "application/sla" => {
                Some(Self::Stl)
            }
            "model/obj" | "application/x-tgif" => Some(Self::Obj),
            "model/ply" | "application/ply" | "application/x-ply" => Some(Self::Ply),
            "model/off" | "application/off" | "application/x-off" => Some(Self::Off),
            _ => None,
        }
    }

    /// The media type of the format.
    #[must_use]
    pub fn media_type(self) -> &'static str {
        FORMATS[self as usize].2
    }
}

impl fmt::Display for MeshFormat {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(FORMATS[*self as usize].1)
    }
}

/// Parses a file's bytes; lengths stay in the file's unit.
pub(super) fn parse(format: MeshFormat, bytes: &[u8]) -> Result<Soup, MeshError> {
    if bytes.is_empty() {
        return Err(MeshError::Empty);
    }
    let read = match format {
        MeshFormat::Stl => stl::read,
        MeshFormat::Obj => obj::read,
        MeshFormat::Ply => ply::read,
        MeshFormat::Off => off::read,
    };
    let read = catch_unwind(AssertUnwindSafe(|| read(bytes)));
    let read = read.unwrap_or(Err(MeshError::Unreadable { format }));
    // Some formats skip unknown lines, and find nothing in a file of another format.
    let read =
        read.and_then(|soup| if soup.1.is_empty() { Err(MeshError::Empty) } else { Ok(soup) });
    read.map_err(|error| {
        // A comment of a binary STL may begin with anything, so only failures are checked.
        match first_word(bytes).filter(|found| *found != format) {
            Some(found) => MeshError::OtherFormat { format, found },
            None => error,
        }
    })
}

/// The format that a file's first word indicates; `None` for an unknown word.
fn first_word(bytes: &[u8]) -> Option<MeshFormat> {
    let word = bytes.split(u8::is_ascii_whitespace).next()?;
    match word {
        b"OFF" | b"COFF" | b"NOFF" | b"CNOFF" => Some(MeshFormat::Off),
        b"ply" => Some(MeshFormat::Ply),
        b"solid" => Some(MeshFormat::Stl),
        b"v" | b"mtllib" => Some(MeshFormat::Obj),
        _ => None,
    }
}

/// Triangulates a polygon as a fan and adds the triangles.
///
/// `polygon` is the polygon's number for errors; fewer than three corners add nothing.
pub(super) fn push_fan(
    triangles: &mut Vec<[u32; 3]>,
    corners: &[u32],
    polygon: usize,
    n_vertices: usize,
) -> Result<(), MeshError> {
    if let Some(found) = corners.iter().find(|corner| **corner as usize >= n_vertices) {
        let found = i64::from(*found);
        return Err(MeshError::Index { triangle: polygon, found, n_vertices });
    }
    let found = triangles.len() + corners.len().saturating_sub(2);
    super::check_count("triangles", found, super::TRIANGLES_MAX)?;
    if let [first, rest @ ..] = corners {
        triangles.extend(rest.windows(2).map(|pair| [*first, pair[0], pair[1]]));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Mesh;

    #[test]
    fn extensions_and_media_types_map_to_formats() {
        assert_eq!(MeshFormat::from_extension(".STL"), Some(MeshFormat::Stl));
        assert_eq!(MeshFormat::from_extension("dae"), None);
        for (format, ..) in FORMATS {
            assert_eq!(MeshFormat::from_media_type(format.media_type()), Some(format));
        }
        assert_eq!(MeshFormat::from_media_type("model/PLY; charset=utf-8"), Some(MeshFormat::Ply));
    }

    #[test]
    fn empty_files_and_units_out_of_range_are_refused() {
        for (format, ..) in FORMATS {
            assert_eq!(Mesh::from_bytes(format, b"", 1.0), Err(MeshError::Empty), "{format}");
            for unit in [0.0, -1.0, f64::NAN, f64::INFINITY] {
                let error = Mesh::from_bytes(format, b"x", unit).unwrap_err();
                assert!(matches!(error, MeshError::Unit { .. }));
            }
        }
    }

    #[test]
    fn the_first_word_reveals_another_format() {
        let files: [(MeshFormat, &[u8]); 4] = [
            (MeshFormat::Off, b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"),
            (MeshFormat::Ply, b"ply\nformat ascii 1.0\nend_header\n"),
            (MeshFormat::Stl, b"solid cube\nendsolid cube\n"),
            (MeshFormat::Obj, b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
        ];
        for (found, file) in files {
            for (format, ..) in FORMATS.into_iter().filter(|(format, ..)| *format != found) {
                // Long enough for a binary STL's header, whose count is then nonsense.
                let file = file.repeat(40);
                let refused = Mesh::from_bytes(format, &file, 1e-3);
                assert_eq!(refused, Err(MeshError::OtherFormat { format, found }));
            }
        }
    }

    proptest::proptest! {
        #[test]
        fn any_bytes_are_read_or_refused(
            bytes in proptest::collection::vec(proptest::num::u8::ANY, 0..400),
            which in 0..4usize,
            head in 0..4usize,
        ) {
            let heads: [&[u8]; 4] =
                [b"", b"solid x\n", b"OFF\n", b"ply\nformat ascii 1.0\nelement vertex 3\n"];
            let file = [heads[head], &bytes].concat();
            let _ = Mesh::from_bytes(FORMATS[which].0, &file, 1e-3);
        }
    }
}
