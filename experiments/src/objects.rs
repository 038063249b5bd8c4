//! Objects that an experiment touches: generated ones or a folder of meshes, and readings of them.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use palpate_core::reading::{Reading, SensorId};
use palpate_core::sensor::SensorDescription;
use palpate_core::symmetry::Symmetry;
use palpate_core::units::MM;
use palpate_sim::kept::{Cause, Kept};
use palpate_sim::mesh::{Mesh, MeshFormat};
use palpate_sim::noise::NoiseLevel;
use palpate_sim::press::{PressConfig, PressSimulator};
use palpate_sim::sampler::{SamplerConfig, sample};
use palpate_sim::{shapes, symmetry};
use rayon::prelude::*;

use crate::report::Progress;

/// A named mesh of the wanted size.
#[derive(Clone)]
pub struct TestObject {
    /// Its name: that of the shape or the file without its extension.
    pub name: String,
    /// Its mesh, metres, origin at its centroid.
    pub mesh: Mesh,
}

/// Objects from our own generator, by name, scaled to `size` metres in their largest dimension.
///
/// # Errors
/// When the generator does not know a name.
pub fn generated(names: &[&str], size: f64) -> anyhow::Result<Vec<TestObject>> {
    let object = |name: &&str| {
        let mesh = shapes::example(name).with_context(|| format!("there is no object {name}"))?;
        Ok(TestObject::new((*name).to_owned(), &mesh, size))
    };
    names.iter().map(object).collect()
}

impl TestObject {
    /// A mesh scaled to `size` metres in its largest dimension, its centroid at the origin.
    #[must_use]
    pub fn new(name: String, mesh: &Mesh, size: f64) -> Self {
        let mesh = mesh.scaled_to_largest_dimension(size);
        Self { name, mesh: mesh.translated(-mesh.centroid()) }
    }
}

/// Every mesh file of a folder in the order of names, scaled to `size` metres in their largest
/// dimension.
///
/// # Errors
/// When the folder or a file in it cannot be read, or it holds no mesh.
pub fn from_folder(folder: &Path, size: f64) -> anyhow::Result<Vec<TestObject>> {
    let entries =
        std::fs::read_dir(folder).with_context(|| format!("cannot read {}", folder.display()))?;
    let mut paths: Vec<PathBuf> = entries.map(|e| Ok(e?.path())).collect::<anyhow::Result<_>>()?;
    paths.sort();
    let mut named = Vec::new();
    for path in paths {
        let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or("");
        let Some(format) = MeshFormat::from_extension(extension) else {
            continue;
        };
        let bytes =
            std::fs::read(&path).with_context(|| format!("cannot read {}", path.display()))?;
        // The unit does not matter: the mesh is scaled to the experiment's size.
        let mesh = Mesh::from_bytes(format, &bytes, MM)
            .with_context(|| format!("{} is not a usable mesh", path.display()))?;
        let name = path.file_stem().map(|stem| stem.to_string_lossy().into_owned());
        named.push(TestObject::new(name.unwrap_or_default(), &mesh, size));
    }
    if named.is_empty() {
        bail!(
            "{} holds no mesh, expected .stl, .obj, .ply, .off, .glb or .3mf files",
            folder.display()
        );
    }
    Ok(named)
}

/// Maximum size of a catalogue whose symmetries are computed; in larger ones that would take
/// longer than everything else.
const SYMMETRIES_MAX: usize = 100;

/// The symmetry of each object's mesh, in its frame. Errors of poses are modulo this symmetry,
/// and the service learns it when it has a mesh.
#[must_use]
pub fn symmetries(objects: &[TestObject]) -> Vec<Symmetry> {
    if objects.len() > SYMMETRIES_MAX {
        return vec![Symmetry::NONE; objects.len()];
    }
    objects.par_iter().map(|object| symmetry::of_mesh(&object.mesh)).collect()
}

/// `n` converged readings of an object by the training sampler, from one seed.
///
/// # Errors
/// When the sampler gives up: the object cannot be touched often enough.
pub fn touch(
    object: &TestObject,
    sensor: &SensorDescription,
    n: usize,
    seed: u64,
) -> anyhow::Result<Vec<Reading>> {
    touch_in_noise(object, sensor, NoiseLevel::NONE, n, seed)
}

/// `n` readings for training and some for tests, by two seeds, as by [`touch`]: those that were
/// kept, or new ones, which are kept.
///
/// # Errors
/// As [`touch`]; the outer ones when the folder cannot be used.
pub fn touch_or_read(
    object: &TestObject,
    sensor: &SensorDescription,
    ([n_train, n_test], seeds): ([usize; 2], [u64; 2]),
    kept: Option<&Kept>,
) -> std::io::Result<anyhow::Result<[Vec<Reading>; 2]>> {
    let simulator = PressSimulator::new(object.mesh.clone(), sensor.clone());
    let config = SamplerConfig::for_simulator(&simulator);
    let cause = kept.map(|kept| (kept, Cause::new(&simulator, &config, &(n_train, n_test, seeds))));
    if let Some((kept, cause)) = &cause
        && let Some(lists) = kept.read(cause, sensor)?
        && let Ok(both) = lists.try_into()
    {
        return Ok(Ok(both));
    }
    let touch = |n, seed| sampled(object, &simulator, n, seed, &config);
    let both = touch(n_train, seeds[0]).and_then(|train| Ok([train, touch(n_test, seeds[1])?]));
    if let (Some((kept, cause)), Ok([train, test])) = (cause, &both) {
        kept.write(&cause, &[train, test])?;
    }
    Ok(both)
}

/// `n` readings of every object, as by [`touch`].
///
/// # Errors
/// When an object cannot be touched often enough.
pub fn touch_all(
    objects: &[TestObject],
    sensor: &SensorDescription,
    n: usize,
    seed: u64,
    progress: Progress<'_>,
) -> anyhow::Result<Vec<Vec<Reading>>> {
    let one = |(done, object)| {
        progress("touching objects", done, objects.len());
        touch(object, sensor, n, seed)
    };
    objects.iter().enumerate().map(one).collect()
}

/// Readings as by [`touch`] under noise beyond the sensor's own, which the controllers feel too.
///
/// # Errors
/// When the sampler gives up: the object cannot be touched often enough.
pub fn touch_in_noise(
    object: &TestObject,
    sensor: &SensorDescription,
    noise_level: NoiseLevel,
    n: usize,
    seed: u64,
) -> anyhow::Result<Vec<Reading>> {
    let press = PressConfig { noise_level, ..PressConfig::for_sensor(sensor) };
    let simulator = PressSimulator::with_config(object.mesh.clone(), sensor.clone(), press);
    sampled(object, &simulator, n, seed, &SamplerConfig::for_simulator(&simulator))
}

/// Readings as by [`touch`], from starts that are tilted by up to `tilt_max` radians.
///
/// # Errors
/// When the sampler gives up: the object cannot be touched often enough.
pub fn touch_tilted(
    object: &TestObject,
    sensor: &SensorDescription,
    tilt_max: f64,
    n: usize,
    seed: u64,
) -> anyhow::Result<Vec<Reading>> {
    let simulator = PressSimulator::new(object.mesh.clone(), sensor.clone());
    let config = SamplerConfig { tilt_max, ..SamplerConfig::for_simulator(&simulator) };
    sampled(object, &simulator, n, seed, &config)
}

fn sampled(
    object: &TestObject,
    simulator: &PressSimulator,
    n: usize,
    seed: u64,
    config: &SamplerConfig,
) -> anyhow::Result<Vec<Reading>> {
    let mut go_on = |_done: usize, _total: usize| ControlFlow::Continue(());
    sample(simulator, SensorId(0), n, seed, config, &mut go_on)
        .with_context(|| format!("cannot touch {} {n} times", object.name))
}
