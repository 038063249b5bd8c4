//! Start and memory of a second server on a NATS cluster, with large content in objects and in the
//! stream.
//!
//! The cluster runs already; its address is an argument. Two stores on it get the same objects with
//! the same mesh files: one puts content in objects beside the stream, as servers do; the other has
//! all of it in messages of the stream, as before. A second server, a process of its own, starts on
//! each store in turn. The experiment measures the time until it listens and until it has checked all
//! records, then reads one mesh from it. All processes share one machine. The figures are of this
//! second server.

use std::f64::consts::{PI, TAU};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::{Context as _, ensure};
use clap::Args;
use glam::DVec3;
use palpate_client::Client;
use palpate_core::rng::{Purpose, Stream};
use palpate_schemas::{CreateObject, MeshFormat, MeshUnit};
use palpate_sim::mesh::Mesh;
use palpate_sim::plot::{Line, Panel, svg};
use serde::Serialize;

use crate::arguments::count;
use crate::own_server::{OwnServer, block_on};
use crate::report::{Outcome, Progress, Report};
use crate::server_process::ServerProcess;
use crate::statistics::median;

/// Size of each mesh file, MB.
const MESH_MB: usize = 10;
/// Bytes of a triangle in an STL file.
const TRIANGLE_BYTES: usize = 50;
/// Radius of the meshes, metres.
const RADIUS: f64 = 0.05;
/// Time in which a server has checked all its records.
const CHECKED_WITHIN: Duration = Duration::from_secs(600);
/// Time after the check at which the memory is read.
const SETTLED: Duration = Duration::from_secs(15);
const LOOK_EVERY: Duration = Duration::from_millis(50);

const RECEIVED: &str = "palpate_store_received_bytes_total";
const FETCHES: &str = "palpate_content_fetches_total";
/// The metric that is there when all records were checked.
const CHECKED: &str = "palpate_records_damaged";

/// Arguments of `large-content`.
#[derive(Args, Clone, Debug, Serialize)]
pub struct LargeContent {
    /// Address of a NATS cluster without streams `NAME-objects` and `NAME-stream` of the name;
    /// `tests/nats install` prints the program of a server.
    #[arg(long, value_name = "URL")]
    pub nats: String,
    /// The program of the second server, `palpate`.
    #[arg(long, value_name = "FILE")]
    pub palpate: PathBuf,
    /// MB of mesh files in the store, each a multiple of 10, ascending.
    #[arg(long, default_values_t = [0, 100, 400], value_delimiter = ',')]
    pub megabytes: Vec<usize>,
    /// Number of starts on each store of each size; figures are their medians.
    #[arg(long, default_value_t = 3, value_parser = count)]
    pub starts: usize,
    /// Seed of everything random.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
}

/// Where content is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
enum Place {
    Objects,
    Stream,
}

impl Place {
    const ALL: [Self; 2] = [Self::Objects, Self::Stream];

    fn name(self) -> &'static str {
        match self {
            Self::Objects => "objects",
            Self::Stream => "stream",
        }
    }
}

/// What was measured of second servers on a store.
#[derive(Serialize)]
struct Measured {
    content_in: Place,
    megabytes: usize,
    /// Until it listens.
    start_seconds: f64,
    /// Until it has checked all records, from its start on.
    checked_seconds: f64,
    /// From the cluster, until then.
    received_mb: f64,
    /// [`SETTLED`] later.
    resident_mb: f64,
    fetches: f64,
    /// From the cluster, for one mesh of [`MESH_MB`]; none without a mesh.
    received_mb_of_a_mesh: Option<f64>,
}

/// Runs the experiment.
///
/// # Errors
/// When the cluster or the program cannot be used, or a server refuses something.
pub fn run(config: &LargeContent, progress: Progress<'_>) -> anyhow::Result<Outcome> {
    let sizes = &config.megabytes;
    ensure!(
        sizes.iter().all(|size| size % MESH_MB == 0) && sizes.is_sorted_by(|a, b| a < b),
        "megabytes are {sizes:?}, expected multiples of {MESH_MB}, ascending"
    );
    ensure!(!sizes.is_empty(), "megabytes are empty");
    let file = mesh_file(config.seed)?;
    block_on(async {
        let addresses = Place::ALL.map(|place| format!("{}-{}", config.nats, place.name()));
        let writers = [
            OwnServer::start_on(&addresses[0]).await?,
            OwnServer::start_with(&addresses[1], |options| palpate_server::NatsOptions {
                content_bytes_min: usize::MAX,
                ..options
            })
            .await?,
        ];
        let (mut all, mut n_meshes) = (Vec::new(), 0);
        for megabytes in sizes {
            for number in n_meshes..megabytes / MESH_MB {
                progress("storing meshes", number, sizes[sizes.len() - 1] / MESH_MB);
                for writer in &writers {
                    put(&writer.client, number, &file).await?;
                }
            }
            n_meshes = megabytes / MESH_MB;
            let mut measured = Place::ALL.map(|_| Vec::new());
            for start in 0..config.starts {
                progress("starting servers", start, config.starts);
                for (place, address) in addresses.iter().enumerate() {
                    let found = measure(&config.palpate, address, Place::ALL[place], *megabytes);
                    measured[place].push(found.await?);
                }
            }
            all.extend(measured.map(|of_place| medians(&of_place)));
        }
        for writer in writers {
            writer.stop().await;
        }
        Ok(outcome(&all))
    })
}

/// A sphere with an uneven equator, as a binary STL file of [`MESH_MB`].
fn mesh_file(seed: u64) -> anyhow::Result<Vec<u8>> {
    // Each of the squares between the circles of latitude has two triangles.
    let n_around = 1_000;
    let n_circles = MESH_MB * 1_000_000 / TRIANGLE_BYTES / 2 / n_around + 1;
    let mut stream = Stream::new(seed, Purpose::Shape, 0);
    let radii: Vec<f64> = (0..n_around).map(|_| RADIUS * stream.uniform(0.99, 1.01)).collect();
    let vertices = (0..n_circles).flat_map(|circle| {
        let (height, width) = (PI * (circle as f64 + 0.5) / n_circles as f64).sin_cos();
        radii.iter().enumerate().map(move |(place, radius)| {
            let (sine, cosine) = (TAU * place as f64 / n_around as f64).sin_cos();
            radius * DVec3::new(height * cosine, height * sine, width)
        })
    });
    let squares = (0..n_circles - 1).flat_map(|circle| (0..n_around).map(move |at| (circle, at)));
    let triangles = squares.flat_map(|(circle, at)| {
        let corner = |down, on| ((circle + down) * n_around + (at + on) % n_around) as u32;
        let [a, b, c, d] = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
        [[a, b, c], [a, c, d]]
    });
    let mesh = Mesh::new(vertices.collect(), triangles.collect()).context("it is no mesh")?;
    Ok(mesh.to_stl_bytes())
}

fn object(number: usize) -> String {
    format!("sphere-{number}")
}

async fn put(client: &Client, number: usize, file: &[u8]) -> anyhow::Result<()> {
    let name = object(number);
    client.create_object(&CreateObject { name: name.clone(), ..CreateObject::default() }).await?;
    client.put_mesh(&name, MeshFormat::Stl, MeshUnit::M, file.to_vec().into()).await?;
    Ok(())
}

/// Starts a second server on a store, and stops it.
async fn measure(
    palpate: &Path,
    address: &str,
    content_in: Place,
    megabytes: usize,
) -> anyhow::Result<Measured> {
    let begun = Instant::now();
    let server = ServerProcess::start(palpate, address, &[]).await?;
    let start_seconds = begun.elapsed().as_secs_f64();
    while server.metric(CHECKED).await.is_err() {
        ensure!(begun.elapsed() < CHECKED_WITHIN, "the records are not checked");
        tokio::time::sleep(LOOK_EVERY).await;
    }
    let checked_seconds = begun.elapsed().as_secs_f64();
    let received = server.metric(RECEIVED).await?;
    // What the check used is given back by and by.
    tokio::time::sleep(SETTLED).await;
    let (fetches, resident) = (server.metric(FETCHES).await?, server.resident_bytes()?);
    let mut received_mb_of_a_mesh = None;
    if megabytes > 0 {
        let read = server.client.mesh(&object(0)).await?;
        ensure!(read.len() >= MESH_MB * 1_000_000, "a mesh has {} bytes", read.len());
        received_mb_of_a_mesh = Some((server.metric(RECEIVED).await? - received) / 1e6);
    }
    server.stop().await?;
    Ok(Measured {
        content_in,
        megabytes,
        start_seconds,
        checked_seconds,
        received_mb: received / 1e6,
        resident_mb: resident / 1e6,
        fetches,
        received_mb_of_a_mesh,
    })
}

/// The medians of several starts on one store.
fn medians(all: &[Measured]) -> Measured {
    let of = |figure: fn(&Measured) -> f64| median(&all.iter().map(figure).collect::<Vec<_>>());
    let of_a_mesh: Vec<f64> = all.iter().filter_map(|one| one.received_mb_of_a_mesh).collect();
    Measured {
        content_in: all[0].content_in,
        megabytes: all[0].megabytes,
        start_seconds: of(|one| one.start_seconds),
        checked_seconds: of(|one| one.checked_seconds),
        received_mb: of(|one| one.received_mb),
        resident_mb: of(|one| one.resident_mb),
        fetches: of(|one| one.fetches),
        received_mb_of_a_mesh: (!of_a_mesh.is_empty()).then(|| median(&of_a_mesh)),
    }
}

fn outcome(all: &[Measured]) -> Outcome {
    let mut report = Report::default();
    for of in all {
        let (place, size) = (of.content_in.name(), of.megabytes);
        let mut state = |figure: &str, value| {
            report.summarise(&format!("{figure}_{place}_{size}"), value);
        };
        state("start_seconds", of.start_seconds);
        state("checked_seconds", of.checked_seconds);
        state("received_mb", of.received_mb);
        state("resident_mb", of.resident_mb);
        state("fetches", of.fetches);
        if let Some(received) = of.received_mb_of_a_mesh {
            state("received_mb_of_a_mesh", received);
        }
        let first = all.iter().find(|first| first.content_in == of.content_in);
        if let Some(first) = first.filter(|first| first.megabytes < size) {
            let more = (size - first.megabytes) as f64;
            state("resident_kb_per_mb", 1e3 * (of.resident_mb - first.resident_mb) / more);
            state("received_kb_per_mb", 1e3 * (of.received_mb - first.received_mb) / more);
        }
    }
    let pairs = all.chunks_exact(Place::ALL.len());
    for (objects, stream) in pairs.map(|pair| (&pair[0], &pair[1])) {
        let mut state = |figure: &str, of: fn(&Measured) -> f64| {
            let ratio = of(objects) / of(stream);
            report.summarise(&format!("{figure}_ratio_{}", objects.megabytes), ratio);
        };
        state("start", |of| of.start_seconds);
        state("checked", |of| of.checked_seconds);
        state("received", |of| of.received_mb);
        state("resident", |of| of.resident_mb);
    }
    for of in all {
        report.row(of);
    }
    let panel = |y: &str, of: fn(&Measured) -> f64| Panel {
        title: "a second server".to_owned(),
        x: "MB of meshes".to_owned(),
        y: y.to_owned(),
        lines: Place::ALL.map(|place| line(all, place, of)).into(),
    };
    let panels = [
        panel("seconds until it listens", |of| of.start_seconds),
        panel("MB from the cluster until all is checked", |of| of.received_mb),
        panel("MB of memory", |of| of.resident_mb),
    ];
    Outcome { report, plot: svg(&panels), pictures: Vec::new() }
}

fn line(all: &[Measured], place: Place, of: fn(&Measured) -> f64) -> Line {
    let of_place = all.iter().filter(|measured| measured.content_in == place);
    let points = of_place.map(|measured| (measured.megabytes as f64, of(measured))).collect();
    Line { name: format!("content in {}", place.name()), points }
}
