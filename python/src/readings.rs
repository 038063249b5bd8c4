//! Readings of one sensor: checked once, from arrays of poses and images.

use std::sync::Arc;

use numpy::{PyReadonlyArray1, PyReadonlyArray2};
use palpate_core::reading::{Reading, ReadingError};
use pyo3::prelude::*;

use crate::sensor::{Known, Sensor};
use crate::{arrays, fault};

/// Longest free path before a press, metres: the server's limit.
const APPROACH_MAX: f64 = 10.0;

/// Checked readings of one sensor.
#[pyclass(frozen, module = "palpate._native")]
pub(crate) struct Readings {
    pub(crate) sensor: Arc<Known>,
    pub(crate) readings: Arc<[Reading]>,
}

#[pymethods]
impl Readings {
    /// The readings with these poses (n × 7, `session_from_sensor`), images (n × taxels, Pa, as
    /// the driver sends them, NaN for a missing taxel) and free paths before them (n, metres).
    #[new]
    #[pyo3(signature = (sensor, poses, images, approach=None))]
    fn new(
        sensor: &Sensor,
        poses: PyReadonlyArray2<'_, f64>,
        images: PyReadonlyArray2<'_, f64>,
        approach: Option<PyReadonlyArray1<'_, f64>>,
    ) -> PyResult<Self> {
        let poses = arrays::poses("poses", &poses)?;
        let images = images.as_array();
        let n = poses.len();
        if images.nrows() != n {
            let detail = format!("has {} rows, expected {n}: one a pose", images.nrows());
            return Err(fault::of("images", detail));
        }
        let paths = approach.as_ref().map(|paths| paths.as_array());
        if let Some(found) = paths.as_ref().map(|paths| paths.len()).filter(|found| *found != n) {
            let detail = format!("has {found} values, expected {n}: one a pose");
            return Err(fault::of("approach", detail));
        }
        let known = Arc::clone(&sensor.known);
        let mut readings = Vec::with_capacity(n);
        for (index, pose) in poses.into_iter().enumerate() {
            let image: Vec<Option<f64>> =
                images.row(index).iter().map(|p| (!p.is_nan()).then_some(*p)).collect();
            let reading = Reading::new(known.id, &known.description, &image, pose);
            let reading = reading.map_err(|error| refuse(index, &error))?;
            let path = paths.as_ref().map_or(0.0, |paths| paths[index]);
            let path = fault::within(&format!("approach[{index}]"), path, 0.0, APPROACH_MAX)?;
            readings.push(reading.after_approach(path));
        }
        Ok(Self { sensor: known, readings: readings.into() })
    }

    fn __len__(&self) -> usize {
        self.readings.len()
    }
}

fn refuse(index: usize, error: &ReadingError) -> PyErr {
    match error {
        ReadingError::Pressure { taxel, .. } => {
            fault::of(format!("images[{index}, {taxel}]"), error)
        }
        ReadingError::TaxelCount { .. } | ReadingError::Missing { .. } => {
            fault::of(format!("images[{index}]"), error)
        }
    }
}
