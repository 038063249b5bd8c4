//! Simulated presses: images at given poses, and touches anywhere on an object.

use std::ops::ControlFlow;

use numpy::{PyArray2, PyReadonlyArray2};
use palpate_core::pose::Pose;
use palpate_core::reading::Reading;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::stop::Stop;
use palpate_sim::press::PressSimulator;
use palpate_sim::sampler::{SamplerConfig, sample};
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::mesh::Mesh;
use crate::sensor::Sensor;
use crate::{arrays, fault, interrupt};

/// Largest number of touches of one call.
pub(crate) const TOUCHES_MAX: usize = 20_000;

/// The images of a sensor pressed into a mesh at poses `object_from_sensor` (n × 7): n × taxels,
/// Pa, as the driver sends them. The noise of press i is stream i of `seed`.
#[pyfunction]
#[pyo3(signature = (mesh, sensor, poses, *, seed))]
pub(crate) fn press<'py>(
    py: Python<'py>,
    mesh: &Mesh,
    sensor: &Sensor,
    poses: PyReadonlyArray2<'py, f64>,
    seed: u64,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let poses = arrays::poses("poses", &poses)?;
    let (mesh, known, stop) = (&mesh.mesh, &sensor.known, Stop::possible());
    let images = interrupt::run(py, &stop, || {
        let simulator = PressSimulator::new(mesh.clone(), known.description.clone());
        let image = |(index, pose): (usize, &Pose)| {
            stop.check();
            let mut stream = Stream::new(seed, Purpose::SensorNoise, index as u64);
            let pressures = simulator.pressures(&simulator.press(*pose), &mut stream);
            known.as_driver(&pressures)
        };
        poses.par_iter().enumerate().map(image).collect::<Vec<_>>()
    })?;
    Ok(arrays::matrix(py, poses.len(), known.description.n_taxels(), images.concat()))
}

/// Poses and images.
type Touches<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>);

/// `n` touches of a mesh that rest in contact, in the mesh's frame: poses (n × 7,
/// `object_from_sensor`) and images (n × taxels, Pa), all determined by `seed`.
#[pyfunction]
#[pyo3(signature = (mesh, sensor, n, *, seed))]
pub(crate) fn touch<'py>(
    py: Python<'py>,
    mesh: &Mesh,
    sensor: &Sensor,
    n: usize,
    seed: u64,
) -> PyResult<Touches<'py>> {
    fault::count("n", n, 1, TOUCHES_MAX)?;
    let (mesh, known, stop) = (&mesh.mesh, &sensor.known, Stop::possible());
    let taken = interrupt::run(py, &stop, || {
        let simulator = PressSimulator::new(mesh.clone(), known.description.clone());
        let config = SamplerConfig::for_simulator(&simulator);
        let mut hear = |_: usize, _: usize| going_on(&stop);
        sample(&simulator, known.id, n, seed, &config, &mut hear)
    })?;
    let readings = taken.map_err(|error| fault::of("mesh", error))?;
    let poses = arrays::poses_to_numpy(py, readings.iter().map(Reading::sent_pose));
    let images = readings.iter().flat_map(|reading| {
        let values: Vec<f64> = reading.values().iter().map(|p| p.unwrap_or(f64::NAN)).collect();
        known.as_driver(&values)
    });
    let images = images.collect();
    Ok((poses, arrays::matrix(py, readings.len(), known.description.n_taxels(), images)))
}

/// Whether to go on with a long work.
pub(crate) fn going_on(stop: &Stop) -> ControlFlow<()> {
    if stop.is_asked() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
}
