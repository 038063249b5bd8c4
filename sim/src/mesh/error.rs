//! Why bytes or numbers are not a mesh: what was found, and what was expected.

use thiserror::Error;

use super::MeshFormat;

/// Why bytes or numbers are not a mesh.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum MeshError {
    /// There is no triangle at all.
    #[error("mesh has no triangle, expected at least one")]
    Empty,
    /// Every triangle is without area, or the whole is a point.
    #[error("mesh of extent {extent} m has no triangle with an area, expected at least one")]
    Degenerate {
        /// The largest dimension, metres.
        extent: f64,
    },
    /// The mesh is larger than anything one could touch.
    #[error("mesh has an extent of {extent} m, expected at most {max} m (wrong unit?)")]
    Huge {
        /// The largest dimension, metres.
        extent: f64,
        /// The largest permitted dimension, metres.
        max: f64,
    },
    /// A count is beyond what is permitted.
    #[error("mesh has {found} {what}, expected at most {max}")]
    TooMany {
        /// What was counted.
        what: &'static str,
        /// How many were found or announced.
        found: usize,
        /// How many are permitted.
        max: usize,
    },
    /// A vertex is infinite or not a number.
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
        /// The index that was found.
        found: i64,
        /// How many vertices there are.
        n_vertices: usize,
    },
    /// The file is shorter than its header promises.
    #[error("{format} file has {found} bytes, expected at least {expected} from its header")]
    Truncated {
        /// The format.
        format: MeshFormat,
        /// Bytes there are.
        found: usize,
        /// Bytes that the header's counts need at the least.
        expected: usize,
    },
    /// A place in the file is not what the format demands.
    #[error("{format} file, line {line}: expected {expected}")]
    Syntax {
        /// The format.
        format: MeshFormat,
        /// The line, counted from 1.
        line: usize,
        /// What should have stood there.
        expected: &'static str,
    },
    /// The file is of another format than was said.
    #[error("the file begins as {found} does, expected {format}: name its own format")]
    OtherFormat {
        /// The format that was said.
        format: MeshFormat,
        /// The format that its first word names.
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
        /// How many vertices there are.
        n_vertices: usize,
    },
    /// The unit of length is not a number of metres.
    #[error("unit is {found} m, expected 1e-9 to 1e6 (0.001 for a file in millimetres)")]
    Unit {
        /// What was given.
        found: f64,
    },
}
