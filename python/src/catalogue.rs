//! Training: surfaces of objects from their meshes or readings, and their calibration.
//!
//! The steps are those of the server's `services/training` for `"sva": false, "surface": true`;
//! `python/tests/test_same_numbers.py` compares the beliefs bit for bit.

use std::hash::{Hash, Hasher};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use glam::DVec3;
use palpate_core::contact::touches;
use palpate_core::reading::Reading;
use palpate_core::stop::Stop;
use palpate_core::symmetry::{Finding, Symmetry};
use palpate_core::training::TrainingSet;
use palpate_recogniser::belief::calibrate::{HeldBack, READINGS};
use palpate_recogniser::belief::hold_out::{Split, calibrated, n_runs, split};
use palpate_recogniser::model::{AppearanceSpace, EvidenceCalibration, SurfaceMap, SurfaceModel};
use palpate_recogniser::train::{
    SurfaceConfig, find_symmetry, learn_space, map_surface, mesh_touches,
};
use palpate_sim::press::PressSimulator;
use palpate_sim::sampler::family::{sample_runs, sample_training};
use palpate_sim::sampler::{SampleError, SamplerConfig};
use palpate_sim::symmetry;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use rayon::prelude::*;

use crate::mesh::Mesh;
use crate::press::{TOUCHES_MAX, going_on};
use crate::readings::Readings;
use crate::saved::Saved;
use crate::sensor::{Known, Sensor};
use crate::{fault, interrupt};

/// Fewest touches of a mesh: the server's limit.
const TOUCHES_MIN: usize = 20;

/// Trained surfaces of objects.
#[pyclass(frozen, module = "palpate._native")]
pub(crate) struct Catalogue {
    pub(crate) names: Vec<String>,
    pub(crate) model: Arc<SurfaceModel>,
    n_readings: Vec<usize>,
}

/// An object with what it is trained from.
struct Given {
    name: String,
    source: Source,
}

enum Source {
    Mesh(palpate_sim::mesh::Mesh),
    Readings(Arc<Known>, Arc<[Reading]>),
}

/// The readings of one object.
struct Material {
    name: String,
    sensor: Arc<Known>,
    split: Split,
    /// All readings, held-out ones included.
    readings: Arc<[Reading]>,
    /// Length of the runs by one sensor each that were held out of a mesh.
    run: Option<usize>,
    /// Centroid and symmetry of a mesh.
    shape: Option<(DVec3, Symmetry)>,
}

/// Arguments with which a pickle makes a catalogue.
type Content<'py> = (Bound<'py, PyBytes>,);

/// A training's failure: the argument, and what is wrong.
type Failure = (String, String);

#[pymethods]
impl Catalogue {
    /// Trains surfaces. `objects` are names with a mesh or readings each; `sensor` touches the
    /// meshes as often as [`mesh_touches`] says. All randomness comes from `seed`.
    #[staticmethod]
    #[pyo3(signature = (
        objects, *, sensor, touches=None, surface_touches=None, seed, progress=None
    ))]
    fn train(
        py: Python<'_>,
        objects: Vec<(String, Bound<'_, PyAny>)>,
        sensor: &Sensor,
        touches: Option<u32>,
        surface_touches: Option<u32>,
        seed: u64,
        progress: Option<Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let [touches, of_surface] =
            mesh_touches(touches, surface_touches).map(|touches| touches as usize);
        fault::count("touches", touches, TOUCHES_MIN, TOUCHES_MAX)?;
        fault::count("surface_touches", of_surface, touches, TOUCHES_MAX)?;
        if objects.is_empty() {
            return Err(fault::of("objects", "came empty, expected at least one object"));
        }
        let mut given: Vec<Given> = Vec::with_capacity(objects.len());
        for (name, source) in objects {
            let argument = format!("objects[{name:?}]");
            if given.iter().any(|known| known.name == name) {
                return Err(fault::of(argument, "is named twice"));
            }
            let source = if let Ok(mesh) = source.cast::<Mesh>() {
                Source::Mesh(mesh.get().mesh.clone())
            } else if let Ok(readings) = source.cast::<Readings>() {
                let readings = readings.get();
                Source::Readings(Arc::clone(&readings.sensor), Arc::clone(&readings.readings))
            } else {
                return Err(fault::of(argument, "is neither a Mesh nor Readings"));
            };
            given.push(Given { name, source });
        }
        let (sensor, stop) = (Arc::clone(&sensor.known), Stop::possible());
        let touches = [touches, of_surface - touches];
        let meshes = given.iter().filter(|one| matches!(one.source, Source::Mesh(_))).count();
        let total = meshes * (touches[0] + touches[1]);
        let done = AtomicUsize::new(0);
        let plan = Plan { sensor, touches, seed, n_objects: given.len(), stop: stop.clone(), done };
        let tell = || match &progress {
            Some(progress) => {
                let done = plan.done.load(Ordering::Relaxed).min(total);
                progress.call1((done, total)).map(|_| ())
            }
            None => Ok(()),
        };
        let trained = interrupt::watched(py, &stop, &mut &tell, || train(&plan, given))?;
        tell()?;
        trained.map_err(|(argument, detail)| fault::of(argument, detail))
    }

    /// Names of the objects, in the order of the training.
    #[getter]
    fn names(&self) -> Vec<String> {
        self.names.clone()
    }

    /// Number of readings of each object.
    #[getter]
    fn n_readings(&self) -> Vec<usize> {
        self.n_readings.clone()
    }

    /// Number of patches of each object's surface.
    #[getter]
    fn n_patches(&self) -> Vec<usize> {
        self.model.maps().iter().map(|map| map.patches().len()).collect()
    }

    /// Origin of each object frame in the frame of the mesh or readings, metres.
    #[getter]
    fn origins(&self) -> Vec<[f64; 3]> {
        self.model.maps().iter().map(|map| map.origin_in_training().to_array()).collect()
    }

    /// The catalogue as bytes, which `from_bytes` of the same version reads.
    fn to_bytes<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &self.saved())
    }

    /// The catalogue of bytes.
    #[staticmethod]
    fn from_bytes(py: Python<'_>, content: &[u8]) -> PyResult<Self> {
        let saved = Saved::from_bytes(content).ok_or_else(|| {
            fault::of("content", "is no catalogue that this version of palpate has saved")
        })?;
        let model = py.detach(|| Arc::new(saved.model()));
        Ok(Self { names: saved.names, model, n_readings: saved.n_readings })
    }

    /// Whether all numbers are equal, as they are saved.
    fn __eq__(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.model, &other.model) || self.saved() == other.saved()
    }

    fn __hash__(&self) -> u64 {
        let mut hasher = std::hash::DefaultHasher::new();
        (&self.names, &self.n_readings).hash(&mut hasher);
        hasher.finish()
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Content<'py>)> {
        let content = slf.get().to_bytes(slf.py());
        Ok((slf.get_type().getattr("from_bytes")?, (content,)))
    }

    fn __repr__(&self) -> String {
        format!("Catalogue({})", self.names.join(", "))
    }
}

impl Catalogue {
    fn saved(&self) -> Vec<u8> {
        Saved::of(&self.names, &self.n_readings, &self.model).to_bytes()
    }
}

/// What all objects of a training share.
struct Plan {
    sensor: Arc<Known>,
    /// Touches of a mesh, and further ones.
    touches: [usize; 2],
    seed: u64,
    n_objects: usize,
    stop: Stop,
    /// Number of touches of meshes so far.
    done: AtomicUsize,
}

fn train(plan: &Plan, given: Vec<Given>) -> Result<Catalogue, Failure> {
    let materials: Result<Vec<Material>, Failure> =
        given.into_par_iter().enumerate().map(|(index, one)| gather(plan, index, one)).collect();
    let materials = materials?;
    check(&materials)?;
    let sets: Vec<TrainingSet<'_>> = materials.iter().map(Material::kept).collect();
    let failed =
        |error: palpate_core::training::TrainingError| ("objects".into(), error.to_string());
    let space = learn_space(&sets, plan.seed).map_err(failed)?;
    let map_one = |(material, set): (&Material, &TrainingSet<'_>)| {
        plan.stop.check();
        map(material, set, &space)
    };
    let maps: Result<Vec<Arc<SurfaceMap>>, Failure> =
        materials.par_iter().zip(&sets).map(map_one).collect();
    plan.stop.check();
    let held_back: Vec<HeldBack<'_>> = materials.iter().map(Material::held_back).collect();
    let model = Arc::new(SurfaceModel::new(space, EvidenceCalibration::default(), maps?));
    let model = calibrated(model, &held_back, plan.seed);
    let n_readings = materials.iter().map(|material| material.readings.len()).collect();
    let names = materials.iter().map(|material| material.name.clone()).collect();
    Ok(Catalogue { names, model, n_readings })
}

impl Material {
    fn all(&self) -> TrainingSet<'_> {
        TrainingSet { readings: &self.readings, sensor: &self.sensor.description }
    }

    fn kept(&self) -> TrainingSet<'_> {
        TrainingSet { readings: &self.split.kept, ..self.all() }
    }

    fn held_back(&self) -> HeldBack<'_> {
        let sensor = &self.sensor.description;
        HeldBack { readings: &self.split.held_back, sensor, run: self.run }
    }

    fn argument(&self) -> String {
        argument(&self.name)
    }
}

fn argument(name: &str) -> String {
    format!("objects[{name:?}]")
}

/// The readings of the object at an index of the training.
fn gather(plan: &Plan, index: usize, given: Given) -> Result<Material, Failure> {
    match given.source {
        Source::Readings(sensor, readings) => {
            let split = split(&readings);
            let name = given.name;
            Ok(Material { name, sensor, split, readings, run: None, shape: None })
        }
        Source::Mesh(mesh) => touch(plan, index, &given.name, mesh),
    }
}

/// Touches a mesh; the object at index i uses seed + i.
fn touch(
    plan: &Plan,
    index: usize,
    name: &str,
    mesh: palpate_sim::mesh::Mesh,
) -> Result<Material, Failure> {
    let failed = |error: SampleError| (argument(name), error.to_string());
    let centroid = mesh.centroid();
    let shape = Some((centroid, symmetry::of_mesh(&mesh).seen_from(centroid)));
    let (sensor, family) = (Arc::clone(&plan.sensor), plan.sensor.family());
    let simulator = PressSimulator::new(mesh, sensor.description.clone());
    let config = SamplerConfig::for_simulator(&simulator);
    let (id, n, seed) = (sensor.id, plan.touches, plan.seed.wrapping_add(index as u64));
    let mut told = 0;
    let mut hear = |done: usize, _: usize| {
        plan.done.fetch_add(done.saturating_sub(told), Ordering::Relaxed);
        told = done;
        going_on(&plan.stop)
    };
    let sampled = sample_training(&simulator, &family, id, n, seed, &config, &mut hear);
    let [readings, more] = sampled.map_err(failed)?;
    let (mut split, run) = if family.is_single() {
        (split(&readings), None)
    } else {
        let runs = (n_runs(plan.n_objects, n[0]), READINGS);
        let taken = sample_runs(&simulator, &family, id, runs, seed, &config, &mut hear);
        let held_back = taken.map_err(failed)?;
        (Split { kept: readings.clone(), held_back }, Some(READINGS))
    };
    split.kept.extend_from_slice(&more);
    let readings = [readings, more].concat();
    let (name, readings) = (name.to_owned(), readings.into());
    Ok(Material { name, sensor, split, readings, run, shape })
}

/// Fails when an object was not touched, or not by images of the first object's shape.
fn check(materials: &[Material]) -> Result<(), Failure> {
    let shape = |material: &Material| {
        let grid = material.sensor.description.grid();
        [grid.rows, grid.cols]
    };
    let expected = shape(&materials[0]);
    for material in materials {
        let sensor = &material.sensor.description;
        if !material.readings.iter().any(|reading| touches(reading, sensor)) {
            let n = material.readings.len();
            let detail = format!("none of {n} readings touched anything, expected contact");
            return Err((material.argument(), detail));
        }
        let found = shape(material);
        if found != expected {
            let detail = format!("has images of {found:?} taxels, expected {expected:?}");
            return Err((material.argument(), detail));
        }
    }
    Ok(())
}

/// The surface of one object, with its symmetry: the mesh's, or what the touches show.
fn map(
    material: &Material,
    set: &TrainingSet<'_>,
    space: &AppearanceSpace,
) -> Result<Arc<SurfaceMap>, Failure> {
    let origin = material.shape.as_ref().map(|(origin, _)| *origin);
    let map = map_surface(set, space, &SurfaceConfig::default(), origin)
        .map_err(|error| (material.argument(), error.to_string()))?;
    let origin_in_training = map.origin_in_training();
    let symmetry = match &material.shape {
        Some((origin, symmetry)) => symmetry.seen_from(origin_in_training - *origin),
        None => match find_symmetry(&material.all(), origin_in_training) {
            Finding::Settled(symmetry) => symmetry,
            Finding::Undetermined { .. } => Symmetry::NONE,
        },
    };
    Ok(Arc::new(map.with_symmetry(symmetry)))
}
