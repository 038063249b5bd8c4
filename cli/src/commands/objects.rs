//! `palpate objects`: objects, their meshes and training readings.

mod interest;

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use clap::{Args, Subcommand};
use palpate_client::schemas::{
    AddTrainingReadings, CreateObject, MeshReport, MeshUnit, ObjectInfo, PageQuery, ProblemType,
    Reading,
};
use palpate_client::{Client, Error as ClientError};
use palpate_core::units::MM;
use palpate_sim::mesh::MeshFormat;
use palpate_sim::shapes;

use super::Context;
use super::labels::{self, LabelArgs, WantedArgs};
use crate::json_file::read_json;
use crate::output::{self, Output};
use crate::robot;

/// Number of readings per request.
const READINGS_PER_REQUEST: usize = 1000;

/// Arguments of `palpate objects`.
#[derive(Debug, Args)]
pub(crate) struct ObjectsArgs {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// List the objects.
    List(WantedArgs),
    /// Set the labels of an object.
    Label(LabelArgs),
    /// Show one object.
    Show {
        /// Id or name of the object.
        object: String,
    },
    /// Add an object, optionally with a mesh.
    #[command(after_help = "Examples:\n  palpate objects add mug --mesh mug.stl --unit mm\n  \
        palpate objects add mug --mesh mug.obj --unit m --description \"the blue one\"")]
    Add {
        /// Unique name of the object.
        name: String,
        /// Mesh file: .stl, .obj, .ply, .off, .glb or .3mf.
        #[arg(long, value_name = "FILE")]
        mesh: Option<PathBuf>,
        /// Unit of the mesh file's coordinates; GLB and 3MF record their own.
        #[arg(long, value_enum)]
        unit: Option<MeshUnit>,
        /// Description for people.
        #[arg(long, default_value = "")]
        description: String,
    },
    /// Upload or replace an object's mesh.
    Mesh {
        /// Id or name of the object.
        object: String,
        /// Mesh file: .stl, .obj, .ply, .off, .glb or .3mf.
        file: PathBuf,
        /// Unit of the mesh file's coordinates; GLB and 3MF record their own.
        #[arg(long, value_enum)]
        unit: Option<MeshUnit>,
    },
    /// Remove an object with its mesh and readings. Trained versions keep it.
    Remove {
        /// Id or name of the object.
        object: String,
    },
    /// Show where a touch tells most about which object it is.
    Interest(interest::InterestArgs),
    /// Training readings of an object.
    Readings {
        #[command(subcommand)]
        action: ReadingsAction,
    },
    /// Write meshes of the public benchmark as STL files in millimetres.
    #[command(after_help = "Examples:\n  palpate objects example mug --out .\n  \
        palpate objects example --all --out meshes\n  \
        palpate objects example --public --out benchmark")]
    Example {
        /// Name of the object.
        #[arg(value_parser = clap::builder::PossibleValuesParser::new(shapes::PUBLIC_NAMES),
              required_unless_present_any = ["all", "public"],
              conflicts_with_all = ["all", "public"])]
        name: Option<String>,
        /// Write the ten example objects.
        #[arg(long)]
        all: bool,
        /// Write all 25 objects of the public benchmark, including the ten examples.
        #[arg(long, conflicts_with = "all")]
        public: bool,
        /// Folder to write to; created if missing.
        #[arg(long, value_name = "DIR", default_value = ".")]
        out: PathBuf,
    },
}

#[derive(Debug, Subcommand)]
enum ReadingsAction {
    /// Add training readings, all in one frame in which the object is at rest.
    Add {
        /// Id or name of the object.
        object: String,
        /// JSON file with a list of the API's `Reading`; `-` reads standard input.
        #[arg(long, value_name = "FILE")]
        file: PathBuf,
    },
    /// List the first training readings.
    List {
        /// Id or name of the object.
        object: String,
        /// Maximum number of readings.
        #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=1000))]
        limit: u32,
    },
}

/// Runs the command.
pub(crate) async fn run(args: ObjectsArgs, context: &Context) -> anyhow::Result<()> {
    let (client, output) = (&context.client, context.output);
    match args.action {
        Action::List(wanted) => {
            let objects = client.objects_that_fit(wanted.query()).await?;
            output.answer(&objects, |objects| table(objects))
        }
        Action::Label(args) => {
            let object = args.thing.clone();
            let object = client.set_object_labels(&object, &args.labels()).await?;
            output.answer(&object, |object| table(std::slice::from_ref(object)))
        }
        Action::Show { object } => {
            let object = client.object(&object).await?;
            output.answer(&object, |object| table(std::slice::from_ref(object)))
        }
        Action::Add { name, mesh, unit, description } => {
            // Detect an unreadable file before the object is created.
            let file = mesh.as_deref().map(|path| mesh_file(path, unit)).transpose()?;
            let request =
                CreateObject { name: name.clone(), description, ..CreateObject::default() };
            let created = client.create_object(&request).await;
            let object = match created {
                Err(error) if error.kind() == Some(ProblemType::Conflict) && file.is_some() => {
                    anyhow::bail!(
                        "the name {name:?} is taken: `palpate objects mesh {name} FILE` replaces \
                         the mesh of that object"
                    );
                }
                other => other?,
            };
            let id = object.id.to_string();
            if let Some((format, bytes)) = file {
                let format = robot::wire_format(format);
                match client.put_mesh(&id, format, unit, bytes.into()).await {
                    Ok(report) => output.say(read_words(&report)),
                    Err(error) => return Err(without_mesh(client, &object, error).await),
                }
            }
            output.say(format!("added object {} ({})", object.name, object.id));
            let object = client.object(&id).await?;
            if output.json { output.answer(&object, |_| String::new()) } else { Ok(()) }
        }
        Action::Mesh { object, file, unit } => {
            let (format, bytes) = mesh_file(&file, unit)?;
            let format = robot::wire_format(format);
            let report = client.put_mesh(&object, format, unit, bytes.into()).await?;
            output.answer(&report, read_words)
        }
        Action::Remove { object } => {
            client.delete_object(&object).await?;
            output.say(format!("removed object {object}"));
            Ok(())
        }
        Action::Interest(args) => interest::run(args, context).await,
        Action::Readings { action } => readings(action, context).await,
        Action::Example { name, all, out, .. } => {
            let names: Vec<&str> = match &name {
                Some(name) => vec![name],
                None if all => shapes::NAMES.to_vec(),
                None => shapes::PUBLIC_NAMES.to_vec(),
            };
            example(&names, &out, output)
        }
    }
}

/// A mesh file to upload; its unit must be known, as the API demands.
fn mesh_file(path: &Path, unit: Option<MeshUnit>) -> anyhow::Result<(MeshFormat, Vec<u8>)> {
    let (format, bytes) = robot::read_mesh_file(path)?;
    anyhow::ensure!(
        unit.is_some() || format.knows_its_unit(),
        "--unit is missing: {format} does not record whether {} is in mm, cm, in or m",
        path.display()
    );
    Ok((format, bytes))
}

async fn readings(action: ReadingsAction, context: &Context) -> anyhow::Result<()> {
    let (client, output) = (&context.client, context.output);
    match action {
        ReadingsAction::Add { object, file } => {
            let readings: Vec<Reading> = read_json(file)?;
            anyhow::ensure!(!readings.is_empty(), "the file holds no readings");
            let mut n_new = 0;
            for part in readings.chunks(READINGS_PER_REQUEST) {
                let part = AddTrainingReadings { readings: part.to_vec() };
                let added = client.add_training_readings(&object, &part).await?;
                n_new += added.n_new;
                output.say(format!("{object} has {} readings", added.n_readings));
            }
            let answer = serde_json::json!({ "sent": readings.len(), "new": n_new });
            output.answer(&answer, |_| format!("{n_new} of {} were new", readings.len()))
        }
        ReadingsAction::List { object, limit } => {
            let query = PageQuery { limit: Some(limit), cursor: None };
            let page = client.training_readings(&object, &query).await?;
            output.answer(&page, |page| {
                output::table(
                    ["index", "robot", "seq", "position (m)", "largest"],
                    page.items.iter().map(|reading| {
                        let place = reading.pose.map_or("–".to_owned(), |pose| {
                            let [x, y, z] = pose.position;
                            format!("{x:.3} {y:.3} {z:.3}")
                        });
                        let largest = reading.image.iter().flatten().fold(0.0, |a, b| b.max(a));
                        [
                            reading.index.to_string(),
                            reading.robot.clone().unwrap_or_default(),
                            reading.seq.map(|seq| seq.to_string()).unwrap_or_default(),
                            place,
                            format!("{largest:.0} Pa"),
                        ]
                    }),
                )
            })
        }
    }
}

fn example(names: &[&str], out: &Path, output: Output) -> anyhow::Result<()> {
    std::fs::create_dir_all(out).with_context(|| format!("cannot make {}", out.display()))?;
    let mut written = Vec::new();
    for name in names {
        let mesh = shapes::example(name).with_context(|| format!("there is no example {name}"))?;
        // Mesh files are usually in millimetres; the mesh is in metres.
        let in_mm = mesh.scaled_to_largest_dimension(mesh.largest_dimension() / MM);
        let path = out.join(format!("{name}.stl"));
        std::fs::write(&path, in_mm.to_stl_bytes())
            .with_context(|| format!("cannot write {}", path.display()))?;
        output.say(format!("wrote {}", path.display()));
        written.push(path);
    }
    if output.json { output.answer(&written, |_| String::new()) } else { Ok(()) }
}

/// Removes an object whose mesh was refused, and reports the reason.
async fn without_mesh(client: &Client, object: &ObjectInfo, error: ClientError) -> anyhow::Error {
    let taken_back = client.delete_object(&object.id.to_string()).await.is_ok();
    let error = anyhow::Error::from(error);
    if taken_back {
        error.context(format!("object {} was not added", object.name))
    } else {
        error.context(format!(
            "object {} is there without a mesh; `palpate objects mesh {} FILE` gives it one",
            object.name, object.name
        ))
    }
}

/// A mesh with the unit it was read in, because the file does not record it.
fn read_words(report: &MeshReport) -> String {
    format!("read as {}: {}", output::word(&report.mesh.unit), mesh_words(report))
}

fn mesh_words(report: &MeshReport) -> String {
    let [x, y, z] = report.size.map(in_mm);
    let triangles = if report.n_triangles == 1 { "triangle" } else { "triangles" };
    let mut words = format!("mesh of {} {triangles}, {x} × {y} × {z} mm", report.n_triangles);
    for warning in &report.warnings {
        words.push_str("\nwarning: ");
        words.push_str(warning);
    }
    words
}

/// A length in millimetres with one decimal, or with three significant digits if it is small.
fn in_mm(metres: f64) -> String {
    let mm = metres / MM;
    if mm >= 1.0 || mm <= 0.0 {
        return format!("{mm:.1}");
    }
    let n_decimals = (2.0 - mm.log10().floor()) as usize;
    format!("{mm:.n_decimals$}")
}

fn table(objects: &[ObjectInfo]) -> String {
    output::table(
        ["name", "id", "mesh", "readings", "labels", "created"],
        objects.iter().map(|object| {
            [
                object.name.clone(),
                object.id.to_string(),
                object.mesh.as_ref().map_or("no", |_| "yes").to_owned(),
                object.n_readings.to_string(),
                labels::words(&object.labels),
                object.created_at.clone(),
            ]
        }),
    )
}

#[cfg(test)]
mod tests {
    use super::in_mm;

    #[test]
    fn a_small_mesh_shows_its_size() {
        let sizes = [0.08, 0.0, 4.2e-5, 9.96e-4].map(in_mm);
        assert_eq!(sizes, ["80.0", "0.0", "0.0420", "0.996"]);
    }
}
