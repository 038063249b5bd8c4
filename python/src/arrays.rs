//! Poses and images between numpy arrays and core's values.

use numpy::ndarray::{Array2, ArrayView1};
use numpy::{IntoPyArray, PyArray2, PyReadonlyArray2};
use palpate_core::pose::{Pose, PoseError};
use pyo3::prelude::*;

use crate::fault;

/// Farthest position along an axis, metres: the server's limit.
const POSITION_MAX: f64 = 1_000.0;

/// The poses of an array of n × 7 numbers: x, y, z in metres, quaternion x, y, z, w.
pub(crate) fn poses(argument: &str, given: &PyReadonlyArray2<'_, f64>) -> PyResult<Vec<Pose>> {
    let given = given.as_array();
    if given.ncols() != 7 {
        let detail = format!("has {} columns, expected 7: x, y, z, qx, qy, qz, qw", given.ncols());
        return Err(fault::of(argument, detail));
    }
    let rows = given.rows().into_iter().enumerate();
    rows.map(|(index, row)| pose(&format!("{argument}[{index}]"), row)).collect()
}

fn pose(argument: &str, row: ArrayView1<'_, f64>) -> PyResult<Pose> {
    let numbers: Vec<f64> = row.iter().copied().collect();
    if let Some(axis) = (0..3).find(|axis| numbers[*axis].abs() > POSITION_MAX) {
        let detail = format!("came {} m, expected within ±{POSITION_MAX} m", numbers[axis]);
        return Err(fault::of(format!("{argument}[{axis}]"), detail));
    }
    let (position, turn) = (&numbers[..3], &numbers[3..]);
    let position = [position[0], position[1], position[2]];
    Pose::new(position, [turn[0], turn[1], turn[2], turn[3]]).map_err(|error| {
        let at = match error {
            PoseError::Position { axis, .. } => format!("{argument}[{axis}]"),
            PoseError::Component { component, .. } => format!("{argument}[{}]", 3 + component),
            PoseError::Norm { .. } => format!("{argument}[3:]"),
        };
        fault::of(at, error)
    })
}

/// The array of poses.
pub(crate) fn poses_to_numpy<'py>(
    py: Python<'py>,
    poses: impl ExactSizeIterator<Item = Pose>,
) -> Bound<'py, PyArray2<f64>> {
    let n = poses.len();
    let numbers = poses
        .flat_map(|pose| pose.translation.to_array().into_iter().chain(pose.rotation.to_array()));
    matrix(py, n, 7, numbers.collect())
}

/// An array of `rows` × `cols` numbers.
///
/// # Panics
/// When there are not that many numbers.
pub(crate) fn matrix(
    py: Python<'_>,
    rows: usize,
    cols: usize,
    numbers: Vec<f64>,
) -> Bound<'_, PyArray2<f64>> {
    let filled = Array2::from_shape_vec((rows, cols), numbers);
    filled.expect("the callers count their numbers").into_pyarray(py)
}
