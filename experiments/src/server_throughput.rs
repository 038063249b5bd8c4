//! Readings per second through the whole service: HTTP in, durable, belief out.
//!
//! The built-in objects are added as meshes and trained over REST; then 1 and 64 robots at
//! once touch objects, each in a session of its own, and post the next reading when the
//! belief after the last one has come (closed loop). Batches of 32 stand beside single
//! readings. A session ends after ten readings (single) or one batch, and the next begins.
//! Client and server share the machine, as in the figure of a fleet's smallest deployment.

use std::sync::Arc;
use std::time::Instant;

use anyhow::{Context as _, bail};
use hdrhistogram::Histogram;
use palpate_client::Client;
use palpate_core::pose::Pose;
use palpate_core::reading as core_reading;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::SensorDescription;
use palpate_core::units::MM;
use palpate_schemas::{
    AddReadings, BeliefDetail, CreateObject, CreateSensor, CreateSession, JobState, MeshFormat,
    MeshUnit, Reading, ReadingsQuery, SensorPreset, StartTraining,
};
use serde_json::json;

use crate::objects;
use crate::plot::{Line, Panel, svg};
use crate::report::{Outcome, Progress, Report};
use crate::wire::on_the_wire;

const SENSOR: &str = "throughput-6x6";
/// The catalogue that is trained.
pub(crate) const CATALOGUE: &str = "throughput";
/// Readings of a session before the robot turns to the next object.
const READINGS_PER_SESSION: usize = 10;
const BATCH: usize = 32;

/// What to run.
#[derive(Clone, Debug)]
pub struct ServerThroughput {
    /// The seed of everything random.
    pub seed: u64,
    /// Training readings an object.
    pub train_readings: u32,
    /// Readings that are posted in each setting.
    pub readings: usize,
}

impl Default for ServerThroughput {
    fn default() -> Self {
        Self { seed: 1, train_readings: 1_000, readings: 1_280 }
    }
}

/// One way of posting.
#[derive(Clone, Copy)]
struct Setting {
    robots: usize,
    batch: usize,
}

/// Runs the experiment against a server that nobody else uses meanwhile.
///
/// # Errors
/// When the server refuses something, or training fails.
pub async fn run(
    config: &ServerThroughput,
    client: &Client,
    command: String,
    progress: Progress<'_>,
) -> anyhow::Result<Outcome> {
    let mut report = Report::new("server-throughput", command, config.seed);
    let readings = Arc::new(prepare(config, client, progress).await?);
    let mut lines = Vec::new();
    for (name, batch) in [("single readings", 1), ("batches of 32", BATCH)] {
        let mut points = Vec::new();
        for robots in [1, 8, 64] {
            progress(name, robots, 64);
            let setting = Setting { robots, batch };
            let n = if robots == 1 { config.readings / 4 } else { config.readings };
            let (rate, latency) = measure(client, &readings, setting, n).await?;
            let ms = |quantile: f64| latency.value_at_quantile(quantile) as f64 / 1e3;
            report.row(vec![
                ("sessions", json!(robots)),
                ("batch", json!(batch)),
                ("readings_per_second", json!(rate)),
                ("requests", json!(latency.len())),
                ("p50_ms", json!(ms(0.5))),
                ("p99_ms", json!(ms(0.99))),
            ]);
            let suffix = if batch == 1 { String::new() } else { format!("_batch_{batch}") };
            report.summarise(&format!("readings_per_second_{robots}{suffix}"), rate);
            report.summarise(&format!("p50_ms_{robots}{suffix}"), ms(0.5));
            report.summarise(&format!("p99_ms_{robots}{suffix}"), ms(0.99));
            points.push((robots as f64, rate));
        }
        lines.push(Line { name: name.to_owned(), points });
    }
    let panel = Panel {
        title: "readings through the whole service".to_owned(),
        x: "concurrent sessions".to_owned(),
        y: "readings per second".to_owned(),
        lines,
    };
    Ok(Outcome { report, plot: svg(&[panel]), pictures: Vec::new() })
}

/// Trains the built-in objects over REST and takes unseen readings of each.
pub(crate) async fn prepare(
    config: &ServerThroughput,
    client: &Client,
    progress: Progress<'_>,
) -> anyhow::Result<Vec<Vec<core_reading::Reading>>> {
    let sensor = CreateSensor {
        name: SENSOR.to_owned(),
        preset: Some(SensorPreset::Digitacts6x6),
        description: None,
        image_order: None,
    };
    client.create_sensor(&sensor).await.context("this server has been measured before")?;
    let mut names = Vec::new();
    let mut readings = Vec::new();
    for object in objects::load(None, 80.0 * MM)? {
        let name = format!("throughput-{}", object.name);
        let create = CreateObject { name: name.clone(), description: String::new() };
        client.create_object(&create).await?;
        let file = object.mesh.to_stl_bytes().into();
        client.put_mesh(&name, MeshFormat::Stl, MeshUnit::M, file).await?;
        names.push(name);
        let description = SensorDescription::digitacts_6x6();
        readings.push(objects::touch(&object, &description, 100, config.seed + 1_000)?);
    }
    let training = StartTraining {
        objects: Some(names),
        sensor: Some(SENSOR.to_owned()),
        readings_per_object: Some(config.train_readings),
        seed: Some(config.seed),
        ..StartTraining::default()
    };
    let job = client.start_training(CATALOGUE, &training).await?;
    let job = client
        .follow_job(job.id, |job| progress("training", job.done as usize, job.total as usize))
        .await?;
    if job.state != JobState::Succeeded {
        bail!("training did not succeed: {}", job.reason.unwrap_or_default());
    }
    Ok(readings)
}

/// Posts about `n` readings; gives readings per second and the latencies in microseconds.
async fn measure(
    client: &Client,
    readings: &Arc<Vec<Vec<core_reading::Reading>>>,
    setting: Setting,
    n: usize,
) -> anyhow::Result<(f64, Histogram<u64>)> {
    let per_session = READINGS_PER_SESSION.max(setting.batch);
    let sessions_per_robot = n.div_ceil(setting.robots * per_session).max(1);
    let started = Instant::now();
    let robots: Vec<_> = (0..setting.robots)
        .map(|robot| {
            let (client, readings) = (client.clone(), readings.clone());
            tokio::spawn(async move {
                work(&client, &readings, robot, setting.batch, sessions_per_robot).await
            })
        })
        .collect();
    let mut all = Histogram::new(3)?;
    let mut posted = 0;
    for robot in robots {
        let (latency, count) = robot.await??;
        all.add(latency)?;
        posted += count;
    }
    Ok((posted as f64 / started.elapsed().as_secs_f64(), all))
}

/// One robot: session after session, each with an object in a pose of its own.
async fn work(
    client: &Client,
    readings: &[Vec<core_reading::Reading>],
    robot: usize,
    batch: usize,
    sessions: usize,
) -> anyhow::Result<(Histogram<u64>, usize)> {
    let mut latency = Histogram::new(3)?;
    let mut posted = 0;
    let index = (batch * 1_000 + robot) as u64;
    let mut stream = Stream::new(7, Purpose::ObjectPose, index);
    for _session in 0..sessions {
        let touched = &readings[stream.index(readings.len())];
        let pose = Pose::from_parts(stream.rotation(), 0.2 * stream.direction());
        let create =
            CreateSession { catalogue: Some(CATALOGUE.to_owned()), ..CreateSession::default() };
        let session = client.create_session(&create).await?.id;
        let n_requests = if batch == 1 { READINGS_PER_SESSION } else { 1 };
        for request in 0..n_requests {
            let body = AddReadings {
                readings: (0..batch)
                    .map(|k| {
                        let reading = touched[stream.index(touched.len())].moved_by(pose);
                        numbered(&reading, robot, request * batch + k)
                    })
                    .collect(),
            };
            let query = ReadingsQuery { belief: Some(BeliefDetail::Full) };
            let begun = Instant::now();
            let added = client.add_readings(session, &body, query).await?;
            latency.record(begun.elapsed().as_micros() as u64)?;
            posted += added.n_new as usize;
        }
        client.close_session(session).await?;
    }
    Ok((latency, posted))
}

/// A reading for the wire, with its robot and its number.
pub(crate) fn numbered(reading: &core_reading::Reading, robot: usize, seq: usize) -> Reading {
    Reading {
        robot: Some(format!("robot-{robot}")),
        seq: Some(seq as u64),
        ..on_the_wire(reading, SENSOR)
    }
}
