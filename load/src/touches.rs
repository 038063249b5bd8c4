//! Touches of the catalogue's objects, simulated before the measurement.

use std::ops::ControlFlow;

use anyhow::{Context as _, ensure};
use palpate_client::Client;
use palpate_core::pose::Pose;
use palpate_core::reading::{Reading, SensorId};
use palpate_core::rng::Stream;
use palpate_core::sensor::SensorDescription;
use palpate_schemas as wire;
use palpate_schemas::SensorPreset;
use palpate_sim::mesh::{Mesh, MeshFormat};
use palpate_sim::press::PressSimulator;
use palpate_sim::sampler::{SampleError, SamplerConfig, sample};

use crate::Progress;
use crate::wire::on_the_wire;

/// The sensor of all robots; every server has it.
pub const SENSOR: SensorPreset = SensorPreset::Digitacts6x6;
/// Maximum number of objects with simulated touches; sessions repeat them.
const OBJECTS_MAX: usize = 20;

/// Touches of each object, in the frame of its mesh.
#[derive(Clone, Debug)]
pub struct Touches(Vec<Vec<Reading>>);

impl Touches {
    /// Touches of objects.
    ///
    /// # Errors
    /// When there is no object, or one without a touch.
    pub fn new(objects: Vec<Vec<Reading>>) -> anyhow::Result<Self> {
        ensure!(!objects.is_empty(), "there is no object to touch");
        ensure!(objects.iter().all(|touches| !touches.is_empty()), "an object has no touches");
        Ok(Self(objects))
    }

    /// `n` touches of each object of a catalogue's current version with a mesh on the server.
    ///
    /// # Errors
    /// When the server refuses a request, or has no mesh of any object.
    pub async fn of_catalogue(
        client: &Client,
        catalogue: &str,
        n: usize,
        seed: u64,
        progress: Progress<'_>,
    ) -> anyhow::Result<Self> {
        let version = client.current_version(catalogue).await?.version;
        let known = client.catalogue_version(catalogue, version).await?.report.objects;
        let mut objects = Vec::new();
        for (place, object) in known.iter().take(OBJECTS_MAX).enumerate() {
            progress("simulating touches", place, known.len().min(OBJECTS_MAX));
            let Some(mesh) = mesh(client, &object.id.to_string()).await? else { continue };
            let seed = seed.wrapping_add(1_000 + place as u64);
            let touching = tokio::task::spawn_blocking(move || touch(mesh, n, seed));
            let touched = touching.await.context("the simulation broke off")?;
            objects.push(touched.with_context(|| format!("cannot touch {}", object.name))?);
        }
        ensure!(
            !objects.is_empty(),
            "the server has no mesh of the objects of catalogue {catalogue:?}: train one of \
             objects with meshes, or let --prepare do it"
        );
        Self::new(objects)
    }

    /// Number of objects.
    #[must_use]
    pub fn n_objects(&self) -> usize {
        self.0.len()
    }

    /// A touch of an object at `session_from_object`, without robot and number.
    pub(super) fn draw(
        &self,
        object: usize,
        session_from_object: Pose,
        stream: &mut Stream,
    ) -> wire::Reading {
        let touches = &self.0[object];
        let reading = touches[stream.index(touches.len())].moved_by(session_from_object);
        on_the_wire(&reading, SENSOR.name())
    }
}

/// The server's mesh of an object, if any.
async fn mesh(client: &Client, id: &str) -> anyhow::Result<Option<Mesh>> {
    let object = match client.object(id).await {
        // It was deleted after its training.
        Err(error) if error.status() == Some(404) => return Ok(None),
        other => other?,
    };
    let Some(info) = object.mesh else { return Ok(None) };
    let format = match info.format {
        wire::MeshFormat::Stl => MeshFormat::Stl,
        wire::MeshFormat::Obj => MeshFormat::Obj,
        wire::MeshFormat::Ply => MeshFormat::Ply,
        wire::MeshFormat::Off => MeshFormat::Off,
        wire::MeshFormat::Glb => MeshFormat::Glb,
        wire::MeshFormat::ThreeMf => MeshFormat::ThreeMf,
    };
    let file = client.mesh(id).await?;
    Ok(Some(Mesh::from_bytes(format, &file, info.unit.metres())?))
}

/// `n` touches of a mesh by the training sampler.
fn touch(mesh: Mesh, n: usize, seed: u64) -> Result<Vec<Reading>, SampleError> {
    let simulator = PressSimulator::new(mesh, SensorDescription::digitacts_6x6());
    let config = SamplerConfig::for_simulator(&simulator);
    sample(&simulator, SensorId(0), n, seed, &config, &mut |_, _| ControlFlow::Continue(()))
}
