//! Error of bytes or numbers that are not a mesh, with the found and the expected value.

use palpate_core::units::{Beyond, Shown};
use thiserror::Error;

use super::MeshFormat;

/// Longest name from a file that an error repeats, letters.
const NAME_LETTERS_MAX: usize = 100;

/// Error of bytes or numbers that are not a mesh.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum MeshError {
    /// There is no triangle at all.
    #[error("mesh has no triangle, expected at least one")]
    Empty,
    /// Every triangle has zero area, or the whole mesh is a point.
    #[error(
        "mesh of extent {} m has no triangle with an area that can be felt: is its unit right?",
        Shown(*.extent)
    )]
    Degenerate {
        /// The largest dimension, metres.
        extent: f64,
    },
    /// The mesh is larger than [`super::EXTENT_MAX`].
    #[error(
        "mesh has an extent of {} m, expected at most {max} m: is its unit right?",
        Beyond(*.extent, [*.max])
    )]
    Huge {
        /// The largest dimension, metres.
        extent: f64,
        /// The largest permitted dimension, metres.
        max: f64,
    },
    /// A count is above its limit.
    #[error("mesh has {found} {what}, expected at most {max}: decimate it")]
    TooMany {
        /// The counted thing.
        what: &'static str,
        /// The count found or announced.
        found: usize,
        /// The maximum count.
        max: usize,
    },
    /// A vertex has a coordinate that is not finite.
    #[error("vertex {vertex} is not finite, expected finite coordinates")]
    NotFinite {
        /// The vertex, counted from 0.
        vertex: usize,
    },
    /// A triangle or polygon names a vertex that does not exist.
    #[error("triangle {triangle} names vertex {found}, expected 0 to below {n_vertices}")]
    Index {
        /// The triangle or polygon, counted from 0.
        triangle: usize,
        /// The given index.
        found: i64,
        /// The number of vertices.
        n_vertices: usize,
    },
    /// The file is shorter than its header requires.
    #[error("{format} file has {found} bytes, expected at least {expected} from its header")]
    Truncated {
        /// The format.
        format: MeshFormat,
        /// The file's length in bytes.
        found: usize,
        /// The length that the header's counts need at least, in bytes.
        expected: usize,
    },
    /// A line of the file violates the format.
    #[error("{format} file, line {line}: expected {expected}")]
    Syntax {
        /// The format.
        format: MeshFormat,
        /// The line, counted from 1.
        line: usize,
        /// The expected content of the line.
        expected: &'static str,
    },
    /// The file is of another format than the one given.
    #[error("the file begins as {found} does, expected {format}: name its own format")]
    OtherFormat {
        /// The given format.
        format: MeshFormat,
        /// The format that its first word indicates.
        found: MeshFormat,
    },
    /// The file is no mesh that is read here.
    #[error("not a {format} file: it is {found}")]
    OtherContent {
        /// The given format.
        format: MeshFormat,
        /// What the file is, and what to do.
        found: &'static str,
    },
    /// The file goes on after its end.
    #[error("{format} file goes on for {bytes} bytes after the end that its header announces")]
    Left {
        /// The format.
        format: MeshFormat,
        /// Number of bytes that were not read.
        bytes: usize,
    },
    /// The file needs an extension or a form that is not read.
    #[error("{format} file needs {name}, which is not read: export it without")]
    Unsupported {
        /// The format.
        format: MeshFormat,
        /// The extension, as the file names it.
        name: Box<str>,
    },
    /// A part of the file contradicts the format.
    #[error("{format} file: {part}: expected {expected}")]
    Part {
        /// The format.
        format: MeshFormat,
        /// The part, as the file names it.
        part: Box<str>,
        /// The expected content.
        expected: &'static str,
    },
    /// The format's reader refused the file.
    #[error("not a readable {format} file")]
    Unreadable {
        /// The format.
        format: MeshFormat,
    },
    /// A corner of an OBJ face names a vertex that does not exist.
    #[error(
        "OBJ file, line {line}: corner {corner} names a vertex that does not exist, expected one \
         of {n_vertices}"
    )]
    Corner {
        /// The line, counted from 1.
        line: usize,
        /// The corner of the face, counted from 0.
        corner: usize,
        /// The number of vertices.
        n_vertices: usize,
    },
    /// The file's format does not record the unit of length, and none was given.
    #[error("the unit is missing, expected m, mm, cm or in: {format} does not record it")]
    UnitMissing {
        /// The format.
        format: MeshFormat,
    },
    /// The file records another unit of length than the one given.
    #[error("one unit is {found} m, but the file says {recorded} m: leave the unit out")]
    UnitContradicts {
        /// The given unit, metres.
        found: f64,
        /// The unit of the file, metres.
        recorded: f64,
    },
    /// The unit of length is out of range.
    #[error("unit is {found} m, expected 1e-9 to 1e6 (0.001 for a file in millimetres)")]
    Unit {
        /// The given unit, metres.
        found: f64,
    },
}

impl MeshError {
    /// The error of a part, which the file names.
    pub(super) fn part(format: MeshFormat, part: &str, expected: &'static str) -> Self {
        Self::Part { format, part: shortened(part), expected }
    }

    /// The error of an extension that is not read, which the file names.
    pub(super) fn unsupported(format: MeshFormat, name: &str) -> Self {
        Self::Unsupported { format, name: shortened(name) }
    }
}

/// The beginning of a name from a file.
fn shortened(name: &str) -> Box<str> {
    match name.char_indices().nth(NAME_LETTERS_MAX) {
        Some((end, _)) => format!("{}…", &name[..end]).into(),
        None => name.into(),
    }
}
