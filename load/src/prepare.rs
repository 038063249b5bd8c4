//! Preparation of a server for load: the built-in objects, added as meshes and trained.

use anyhow::{Context as _, bail};
use palpate_client::Client;
use palpate_schemas::{
    CreateObject, JobState, MeshFormat, MeshUnit, ProblemType, SensorKnowledge, StartTraining,
};
use palpate_sim::shapes;

use super::touches::SENSOR;
use crate::Progress;

/// Adds the built-in objects as `load-…` and trains `catalogue` on them, unless its current
/// version has them all.
///
/// # Errors
/// When the server refuses a request, or the training fails.
pub async fn prepare(
    client: &Client,
    catalogue: &str,
    readings_per_object: u32,
    seed: u64,
    progress: Progress<'_>,
) -> anyhow::Result<()> {
    let names: Vec<String> = shapes::NAMES.iter().map(|shape| format!("load-{shape}")).collect();
    if knows_all(client, catalogue, &names).await? {
        return Ok(());
    }
    for (place, (shape, name)) in shapes::NAMES.iter().zip(&names).enumerate() {
        progress("adding objects", place, names.len());
        let create = CreateObject { name: name.clone(), ..CreateObject::default() };
        match client.create_object(&create).await {
            Err(error) if error.kind() == Some(ProblemType::Conflict) => {}
            other => drop(other?),
        }
        let mesh = shapes::example(shape).context("every name has its shape")?;
        let file = mesh.to_stl_bytes().into();
        client.put_mesh(name, MeshFormat::Stl, MeshUnit::M, file).await?;
    }
    let training = StartTraining {
        objects: Some(names),
        sensor: Some(SENSOR.name().to_owned()),
        // The robots press with the description itself.
        sensor_knowledge: Some(SensorKnowledge::Measured),
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
