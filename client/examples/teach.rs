//! Teaches objects from their meshes: uploads the files, trains a catalogue, shows its confusions.
//!
//! ```sh
//! palpate objects example mug --out . && palpate objects example hammer --out .
//! cargo run -p palpate-client --example teach -- mug.stl hammer.stl
//! ```
//! Every object is named after its file, whose numbers are millimetres. The server's address is in
//! `PALPATE_SERVER`.
#![expect(clippy::print_stdout, reason = "an example shows its answers")]

use std::path::Path;

use palpate_client::Client;
use palpate_client::schemas::{
    CreateObject, JobState, MeshFormat, MeshUnit, SensorKnowledge, StartTraining,
};

#[tokio::main]
async fn main() -> Result<(), Box<dyn std::error::Error>> {
    let files: Vec<String> = std::env::args().skip(1).collect();
    let address = std::env::var("PALPATE_SERVER");
    let client = Client::new(address.as_deref().unwrap_or("http://127.0.0.1:7411"))?;

    let mut names = Vec::new();
    for file in &files {
        let name = Path::new(file).file_stem().ok_or("expected STL files")?.to_string_lossy();
        let object = CreateObject { name: name.to_string(), ..CreateObject::default() };
        client.create_object(&object).await?;
        let mesh = std::fs::read(file)?.into();
        let report = client.put_mesh(&name, MeshFormat::Stl, MeshUnit::Mm, mesh).await?;
        // Half of all mistakes with meshes are units: look at the size.
        println!("{name}: {:.0} mm long", 1e3 * report.size.into_iter().fold(0.0, f64::max));
        names.push(name.to_string());
    }

    // The simulated arm of these examples has exactly the described sensor; for a real one leave
    // `sensor_knowledge` out.
    let sensor_knowledge = Some(SensorKnowledge::Measured);
    let training =
        StartTraining { objects: Some(names), sensor_knowledge, ..StartTraining::default() };
    let job = client.start_training("default", &training).await?;
    let job = client.follow_job(job.id, |job| println!("{} of {}", job.done, job.total)).await?;
    if job.state != JobState::Succeeded {
        return Err(job.reason.unwrap_or_default().into());
    }
    let version = job.version.ok_or("a training that succeeds has a version")?;
    println!("version {version} of the catalogue default is trained");
    Ok(())
}
