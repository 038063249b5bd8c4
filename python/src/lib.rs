//! The extension module `palpate._native`: Palpate's mathematics for Python, without a server.
//!
//! It calls the functions that the server calls, in the same order, so the numbers are the
//! server's bit for bit. Arrays come as numpy arrays in SI units; poses are seven numbers, x, y,
//! z and a quaternion x, y, z, w. Long work runs without Python's lock and ends on Ctrl-C. The
//! typed wrapper is `palpate/local.py`.

mod fault;
mod interrupt;
mod arrays;
mod mesh;
mod sensor;
mod readings;
mod press;
mod saved;
mod catalogue;
mod recognition;

/// Palpate's mathematics: meshes, sensors, presses, trainings and beliefs.
#[pyo3::pymodule]
mod _native {
    #[pymodule_export]
    use super::catalogue::Catalogue;
    #[pymodule_export]
    use super::mesh::Mesh;
    #[pymodule_export]
    use super::press::{press, touch};
    #[pymodule_export]
    use super::readings::Readings;
    #[pymodule_export]
    use super::recognition::Recognition;
    #[pymodule_export]
    use super::sensor::Sensor;
}
