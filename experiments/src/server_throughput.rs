//! Readings per second through the whole service: HTTP in, durable, belief out.
//!
//! The built-in objects are added as meshes and trained over REST; then 1 and 64 robots at once
//! touch objects, each in a session of its own, and post the next reading when the belief after
//! the last one has come (closed loop). Batches of 32 stand beside single readings. A session
//! ends after ten readings (single) or one batch, and the next begins. Client and server share
//! the machine. Then the same robots post in an open loop at 60 % of the largest rate, and the
//! processor time of a reading stands beside that of an echo and of the recogniser.

mod echo;
mod cost;

use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::Context as _;
use clap::Args;
use hdrhistogram::Histogram;
use palpate_client::Client;
use palpate_core::pose::Pose;
use palpate_core::reading as core_reading;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::SensorDescription;
use palpate_load::wire::on_the_wire;
use palpate_load::{Arrivals, LoadConfig, MemorySource, Mix, SENSOR, Touches};
use palpate_schemas::{AddReadings, BeliefDetail, CreateSession, Reading, ReadingsQuery};
use palpate_sim::plot::{Line, Panel, svg};
use palpate_sim::shapes;
use serde::Serialize;

use crate::arguments::count;
use crate::objects;
use crate::own_server::{OwnServer, block_on};
use crate::report::{Outcome, Progress, Report};

/// The catalogue that is trained.
pub(crate) const CATALOGUE: &str = "throughput";
/// Readings of a session before the robot moves to the next object.
const READINGS_PER_SESSION: usize = 10;
const BATCH: usize = 32;
/// Duration of the open loop.
const OPEN_LOOP: Duration = Duration::from_secs(10);

/// Arguments of `server-throughput`.
#[derive(Args, Clone, Debug, Serialize)]
pub struct ServerThroughput {
    /// Seed of everything random.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Training readings per object.
    #[arg(long, default_value_t = 1_000)]
    pub train_readings: u32,
    /// Readings posted in each setting.
    #[arg(long, default_value_t = 1_280, value_parser = count)]
    pub readings: usize,
}

/// One way of posting.
#[derive(Clone, Copy)]
pub(crate) struct Setting {
    pub(crate) robots: usize,
    pub(crate) batch: usize,
    pub(crate) belief: BeliefDetail,
}

/// What robots posted.
pub(crate) struct Posted {
    pub(crate) posted: usize,
    pub(crate) seconds: f64,
    /// Latencies of requests with readings, microseconds.
    pub(crate) latency: Histogram<u64>,
}

/// Runs the experiment against a server of its own.
///
/// # Errors
/// When the server cannot be started or refuses something, or training fails.
pub fn run(config: &ServerThroughput, progress: Progress<'_>) -> anyhow::Result<Outcome> {
    block_on(async {
        let server = OwnServer::start().await?;
        let outcome = run_against(config, &server, progress).await;
        server.stop().await;
        outcome
    })
}

#[derive(Serialize)]
struct Throughput {
    sessions: usize,
    batch: usize,
    readings_per_second: f64,
    requests: u64,
    p50_ms: f64,
    p99_ms: f64,
}

async fn run_against(
    config: &ServerThroughput,
    server: &OwnServer,
    progress: Progress<'_>,
) -> anyhow::Result<Outcome> {
    let client = &server.client;
    let mut report = Report::default();
    let readings = Arc::new(prepare(config, client, progress).await?);
    let (mut lines, mut peak) = (Vec::new(), 0.0_f64);
    for (name, batch) in [("single readings", 1), ("batches of 32", BATCH)] {
        let mut points = Vec::new();
        for robots in [1, 8, 64] {
            progress(name, robots, 64);
            let setting = Setting { robots, batch, belief: BeliefDetail::Full };
            let n = if robots == 1 { config.readings / 4 } else { config.readings };
            let Posted { posted, seconds, latency } =
                measure(client, &readings, setting, n).await?;
            let rate = posted as f64 / seconds;
            if batch == 1 {
                peak = peak.max(rate);
            }
            let ms = |quantile: f64| latency.value_at_quantile(quantile) as f64 / 1e3;
            report.row(Throughput {
                sessions: robots,
                batch,
                readings_per_second: rate,
                requests: latency.len(),
                p50_ms: ms(0.5),
                p99_ms: ms(0.99),
            });
            let suffix = if batch == 1 { String::new() } else { format!("_batch_{batch}") };
            report.summarise(&format!("readings_per_second_{robots}{suffix}"), rate);
            report.summarise(&format!("p50_ms_{robots}{suffix}"), ms(0.5));
            report.summarise(&format!("p99_ms_{robots}{suffix}"), ms(0.99));
            points.push((robots as f64, rate));
        }
        lines.push(Line { name: name.to_owned(), points });
    }
    progress("60 % of the peak", 0, 1);
    open_loop(client, 0.6 * peak, &readings, config, &mut report).await?;
    cost::report(config, server, &readings, &mut report, progress).await?;
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
    palpate_load::prepare(client, CATALOGUE, config.train_readings, config.seed, progress).await?;
    let description = SensorDescription::digitacts_6x6();
    let objects = objects::generated(&shapes::NAMES, shapes::LARGEST_DIMENSION)?;
    let touched =
        objects.iter().map(|object| objects::touch(object, &description, 100, config.seed + 1_000));
    touched.collect()
}

/// Reports the latencies of all requests and of each kind when `rate` of them a second are due,
/// 60 % of the largest rate of readings.
async fn open_loop(
    client: &Client,
    rate: f64,
    readings: &[Vec<core_reading::Reading>],
    config: &ServerThroughput,
    report: &mut Report,
) -> anyhow::Result<()> {
    let load = LoadConfig {
        seed: config.seed,
        catalogue: CATALOGUE.to_owned(),
        method: None,
        belief: BeliefDetail::Full,
        rates: vec![rate],
        arrivals: Arrivals::Poisson,
        duration: OPEN_LOOP,
        warmup: OPEN_LOOP / 5,
        soak: None,
        sessions: 64,
        readings_per_session: READINGS_PER_SESSION as u32,
        mix: Mix { readings: 1.0, beliefs: 0.0, next_touches: 0.0 },
        in_flight_max: 1_024,
        polite: false,
    };
    let touches = Touches::new(readings.to_vec())?;
    let measured =
        palpate_load::run(&load, client, touches, &MemorySource::Metrics, |_| ()).await?;
    let step = measured.steps.first().context("one rate, one step")?;
    let all = step.accepted_latency.as_ref().context("some requests are accepted")?;
    report.summarise("p99_ms_at_60_percent", all.p99_ms);
    for kind in &step.operations {
        let Some(latency) = &kind.accepted_latency else { continue };
        let name = kind.operation.name();
        report.summarise(&format!("p50_ms_at_60_percent_{name}"), latency.p50_ms);
        report.summarise(&format!("p99_ms_at_60_percent_{name}"), latency.p99_ms);
    }
    Ok(())
}

/// Posts about `n` readings in a closed loop.
pub(crate) async fn measure(
    client: &Client,
    readings: &Arc<Vec<Vec<core_reading::Reading>>>,
    setting: Setting,
    n: usize,
) -> anyhow::Result<Posted> {
    let per_session = READINGS_PER_SESSION.max(setting.batch);
    let sessions_per_robot = n.div_ceil(setting.robots * per_session).max(1);
    let started = Instant::now();
    let robots: Vec<_> = (0..setting.robots)
        .map(|robot| {
            let (client, readings) = (client.clone(), readings.clone());
            tokio::spawn(async move {
                work(&client, &readings, robot, setting, sessions_per_robot).await
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
    Ok(Posted { posted, seconds: started.elapsed().as_secs_f64(), latency: all })
}

/// One robot: session after session, each with an object in a pose of its own.
async fn work(
    client: &Client,
    readings: &[Vec<core_reading::Reading>],
    robot: usize,
    Setting { batch, belief, .. }: Setting,
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
            let query = ReadingsQuery { belief: Some(belief) };
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
        ..on_the_wire(reading, SENSOR.name())
    }
}
