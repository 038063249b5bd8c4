//! Makes a server ready for load: the built-in objects, added as meshes and trained.

use anyhow::bail;
use palpate_client::Client;
use palpate_core::units::MM;
use palpate_schemas::{CreateObject, JobState, MeshFormat, MeshUnit, ProblemType, StartTraining};

use super::touches::SENSOR;
use crate::objects;
use crate::report::Progress;

/// The largest dimension of every object.
const SIZE: f64 = 80.0 * MM;

/// Adds the built-in objects as `load-…` and trains `catalogue` of them, unless its current
/// version knows them all.
///
/// # Errors
/// When the server refuses something, or the training fails.
pub async fn prepare(
    client: &Client,
    catalogue: &str,
    readings_per_object: u32,
    seed: u64,
    progress: Progress<'_>,
) -> anyhow::Result<()> {
    let objects = objects::load(None, SIZE)?;
    let names: Vec<String> = objects.iter().map(|object| format!("load-{}", object.name)).collect();
    if knows_all(client, catalogue, &names).await? {
        return Ok(());
    }
    for (place, (object, name)) in objects.iter().zip(&names).enumerate() {
        progress("adding objects", place, objects.len());
        let create = CreateObject { name: name.clone(), description: String::new() };
        match client.create_object(&create).await {
            Err(error) if error.kind() == Some(ProblemType::Conflict) => {}
            other => drop(other?),
        }
        let file = object.mesh.to_stl_bytes().into();
        client.put_mesh(name, MeshFormat::Stl, MeshUnit::M, file).await?;
    }
    let training = StartTraining {
        objects: Some(names),
        sensor: Some(SENSOR.name().to_owned()),
        readings_per_object: Some(readings_per_object),
        seed: Some(seed),
        ..StartTraining::default()
    };
    let job = client.start_training(catalogue, &training).await?;
    let show = |job: &palpate_schemas::Job| {
        progress("training", job.done as usize, job.total as usize);
    };
    let job = client.follow_job(job.id, show).await?;
    if job.state != JobState::Succeeded {
        bail!("the training did not succeed: {}", job.reason.unwrap_or_default());
    }
    Ok(())
}

async fn knows_all(client: &Client, catalogue: &str, names: &[String]) -> anyhow::Result<bool> {
    let version = match client.current_version(catalogue).await {
        Err(error) if matches!(error.status(), Some(404 | 409)) => return Ok(false),
        other => other?.version,
    };
    let known = client.catalogue_version(catalogue, version).await?.report.objects;
    Ok(names.iter().all(|name| known.iter().any(|object| object.name == *name)))
}
