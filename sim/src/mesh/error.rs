//! Error of bytes or numbers that are not a mesh, with the found and the expected value.

use palpate_core::units::{Beyond, Shown};
use thiserror::Error;

use super::MeshFormat;

/// Error of bytes or numbers that are not a mesh.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum MeshError {
    /// There is no triangle at all.
    #[error("mesh has no triangle, expected at least one")]
    Empty,
    /// Every triangle has zero area, or the whole mesh is a point.
    #[error(
        "mesh of extent {} m has no triangle with an area, expected at least one", Shown(*extent)
    )]
    Degenerate {
        /// The largest dimension, metres.
        extent: f64,
    },
    /// The mesh is larger than [`super::EXTENT_MAX`].
    #[error(
        "mesh has an extent of {} m, expected at most {max} m (wrong unit?)",
        Beyond(*extent, [*max])
    )]
    Huge {
        /// The largest dimension, metres.
        extent: f64,
        /// The largest permitted dimension, metres.
        max: f64,
    },
    /// A count is above its limit.
    #[error("mesh has {found} {what}, expected at most {max}")]
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
    /// The unit of length is out of range.
    #[error("unit is {found} m, expected 1e-9 to 1e6 (0.001 for a file in millimetres)")]
    Unit {
        /// The given unit, metres.
        found: f64,
    },
}
