//! One catalogue on one server with all objects, and divided over two and four servers.
//!
//! The servers are processes of their own that share a NATS cluster, whose address is an argument.
//! Objects are the built-in ones, then random ones, trained by the first server. One robot at a time
//! plays the same sessions each time, reading by reading to the servers in turn. The figures
//! are the memory of surfaces and of the whole process (mean over the servers), the time of a
//! reading, and the share of sessions whose last belief equals that of one server bit for bit. All processes share
//! one machine, so that more servers are hardly faster here.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use anyhow::{Context as _, bail, ensure};
use clap::Args;
use hdrhistogram::Histogram;
use palpate_client::Client;
use palpate_core::pose::Pose;
use palpate_core::reading::Reading;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::SensorDescription;
use palpate_schemas::{
    AddReadings, Belief, BeliefDetail, BeliefQuery, CreateObject, CreateSession, JobState,
    MeshFormat, MeshUnit, ReadingsQuery, SensorKnowledge, Session, StartTraining,
};
use palpate_sim::plot::{Line, Panel, svg};
use palpate_sim::shapes::{self, assembled};
use serde::Serialize;

use crate::arguments::count;
use crate::objects::{TestObject, generated, touch};
use crate::own_server::block_on;
use crate::report::{Outcome, Progress, Report};
use crate::server_process::ServerProcess;
use crate::server_throughput::numbered;

/// The metric of the surfaces in memory.
const SURFACE_BYTES: &str = "palpate_model_bytes{part=\"surface\"}";
/// Memory for models, in MB: more than any catalogue here takes.
const MODEL_MEMORY_MB: &str = "20000";
/// Numbers of servers.
const SERVERS: [usize; 3] = [1, 2, 4];
/// The catalogue that is trained.
const CATALOGUE: &str = "divided";
/// Readings of an object to choose a session's from.
const TOUCHES: usize = 40;
/// Interval at which a training is looked at.
const LOOK_EVERY: Duration = Duration::from_millis(200);
/// Time in which all servers hold their blocks.
const SETTLED_WITHIN: Duration = Duration::from_secs(300);

/// Arguments of `divided-servers`.
#[derive(Args, Clone, Debug, Serialize)]
pub struct DividedServers {
    /// Address of a NATS cluster without a stream of the name; `tests/nats install` prints the
    /// program of a server.
    #[arg(long, value_name = "URL")]
    pub nats: String,
    /// The program of the servers, `palpate`.
    #[arg(long, value_name = "FILE")]
    pub palpate: PathBuf,
    /// Number of objects, from 65 on: fewer are not divided.
    #[arg(long, default_value_t = 1_000, value_parser = count)]
    pub objects: usize,
    /// Training readings per object.
    #[arg(long, default_value_t = 300)]
    pub train_readings: u32,
    /// Copies of each object among several servers.
    #[arg(long, default_value_t = 1)]
    pub copies: u32,
    /// Sessions, each with an object of its own.
    #[arg(long, default_value_t = 20, value_parser = count)]
    pub sessions: usize,
    /// Readings of a session.
    #[arg(long, default_value_t = 10, value_parser = count)]
    pub readings: usize,
    /// Seed of everything random.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
}

/// What was measured of some servers.
#[derive(Serialize)]
struct Measured {
    servers: usize,
    surface_mb: f64,
    resident_mb: f64,
    p50_ms: f64,
    p99_ms: f64,
    /// Share of sessions whose last belief equals that of one server.
    equal: f64,
}

/// Runs the experiment with servers of its own.
///
/// # Errors
/// When the cluster or the program cannot be used, a server refuses something, or training fails.
pub fn run(config: &DividedServers, progress: Progress<'_>) -> anyhow::Result<Outcome> {
    let objects = objects(config)?;
    let sessions = sessions(config, &objects, progress)?;
    block_on(async {
        let first = start(config, None).await?;
        train(config, &first.client, &objects, progress).await?;
        // Its memory is that of a training.
        first.stop().await?;
        let (mut all, mut expected) = (Vec::new(), Vec::new());
        for n in SERVERS {
            progress("servers", n, SERVERS[SERVERS.len() - 1]);
            let copies = (n > 1).then_some(config.copies);
            let mut servers = Vec::new();
            for _ in 0..n {
                servers.push(start(config, copies).await?);
            }
            let (measured, beliefs) = measure(config, &servers, &sessions, &expected).await?;
            all.push(measured);
            if expected.is_empty() {
                expected = beliefs;
            }
            for server in servers {
                server.stop().await?;
            }
        }
        Ok(outcome(&all))
    })
}

/// A server on the cluster; it divides catalogues if there are `copies`.
async fn start(config: &DividedServers, copies: Option<u32>) -> anyhow::Result<ServerProcess> {
    let copies = copies.map(|copies| copies.to_string());
    let mut more = vec!["--model-memory-mb", MODEL_MEMORY_MB];
    if let Some(copies) = &copies {
        more.extend(["--divide-copies", copies, "--divide-wait-ms", "60000"]);
    }
    ServerProcess::start(&config.palpate, &config.nats, &more).await
}

fn objects(config: &DividedServers) -> anyhow::Result<Vec<TestObject>> {
    let mut objects = generated(&shapes::NAMES, shapes::LARGEST_DIMENSION)?;
    objects.truncate(config.objects);
    for index in objects.len()..config.objects {
        let mesh = assembled(config.seed, index as u64).context("a random object is connected")?;
        objects.push(TestObject { name: format!("assembled-{index}"), mesh });
    }
    Ok(objects)
}

/// The readings of every session: of an object each, in a pose of its own.
fn sessions(
    config: &DividedServers,
    objects: &[TestObject],
    progress: Progress<'_>,
) -> anyhow::Result<Vec<Vec<Reading>>> {
    let sensor = SensorDescription::digitacts_6x6();
    let mut stream = Stream::new(config.seed, Purpose::ObjectPose, 0);
    let session = |index: usize| {
        progress("touching objects", index, config.sessions);
        let object = &objects[index * objects.len() / config.sessions.max(1) % objects.len()];
        let touched = touch(object, &sensor, TOUCHES, config.seed + 1_000)?;
        let pose = Pose::from_parts(stream.rotation(), 0.2 * stream.direction());
        let readings =
            (0..config.readings).map(|_| touched[stream.index(touched.len())].moved_by(pose));
        Ok(readings.collect())
    };
    (0..config.sessions).map(session).collect()
}

async fn train(
    config: &DividedServers,
    client: &Client,
    objects: &[TestObject],
    progress: Progress<'_>,
) -> anyhow::Result<()> {
    for (place, object) in objects.iter().enumerate() {
        progress("adding objects", place, objects.len());
        let create = CreateObject { name: object.name.clone(), ..CreateObject::default() };
        client.create_object(&create).await?;
        let file = object.mesh.to_stl_bytes().into();
        client.put_mesh(&object.name, MeshFormat::Stl, MeshUnit::M, file).await?;
    }
    let training = StartTraining {
        // Touches are by the description itself.
        sensor_knowledge: Some(SensorKnowledge::Measured),
        readings_per_object: Some(config.train_readings),
        seed: Some(config.seed),
        sva: Some(false),
        surface: Some(true),
        strict: Some(true),
        ..StartTraining::default()
    };
    let id = client.start_training(CATALOGUE, &training).await?.id;
    loop {
        let job = client.job(id).await?;
        match job.state {
            JobState::Succeeded => return Ok(()),
            JobState::Failed | JobState::Cancelled => bail!("the training failed: {job:?}"),
            JobState::Queued | JobState::Running => tokio::time::sleep(LOOK_EVERY).await,
        }
    }
}

/// Plays all sessions; also returns the last beliefs.
async fn measure(
    config: &DividedServers,
    servers: &[ServerProcess],
    sessions: &[Vec<Reading>],
    expected: &[Belief],
) -> anyhow::Result<(Measured, Vec<Belief>)> {
    settle(config, servers).await?;
    let mut latency = Histogram::<u64>::new(3)?;
    let mut beliefs = Vec::new();
    for (robot, readings) in sessions.iter().enumerate() {
        let first = &servers[robot % servers.len()].client;
        let session = begin(first).await?.id;
        for (seq, reading) in readings.iter().enumerate() {
            let readings = vec![numbered(reading, robot, seq)];
            let query = ReadingsQuery { belief: Some(BeliefDetail::Full) };
            let begun = Instant::now();
            first.add_readings(session, &AddReadings { readings }, query).await?;
            latency.record(begun.elapsed().as_micros() as u64)?;
        }
        let belief = first.belief(session, BeliefQuery::default()).await?;
        ensure!(!belief.partial, "a belief is partial: {} objects", belief.n_missing_objects);
        beliefs.push(belief);
        first.close_session(session).await?;
    }
    let (mut surface, mut resident) = (0.0, 0.0);
    for server in servers {
        surface += server.metric(SURFACE_BYTES).await? / 1e6;
        resident += server.resident_bytes()? / 1e6;
    }
    let is_equal = |(found, one): &(&Belief, &Belief)| {
        Belief { session: one.session, ..(*found).clone() } == **one
    };
    let n_equal = beliefs.iter().zip(expected).filter(is_equal).count();
    let ms = |quantile: f64| latency.value_at_quantile(quantile) as f64 / 1e3;
    let measured = Measured {
        servers: servers.len(),
        surface_mb: surface / servers.len() as f64,
        resident_mb: resident / servers.len() as f64,
        p50_ms: ms(0.5),
        p99_ms: ms(0.99),
        equal: if expected.is_empty() { 1.0 } else { n_equal as f64 / beliefs.len() as f64 },
    };
    Ok((measured, beliefs))
}

async fn begin(client: &Client) -> anyhow::Result<Session> {
    let create =
        CreateSession { catalogue: Some(CATALOGUE.to_owned()), ..CreateSession::default() };
    Ok(client.create_session(&create).await?)
}

/// Opens a session on each server, and waits until every block has as many copies as it should.
async fn settle(config: &DividedServers, servers: &[ServerProcess]) -> anyhow::Result<()> {
    let begun = Instant::now();
    for server in servers {
        let session = begin(&server.client).await?.id;
        server.client.belief(session, BeliefQuery::default()).await?;
        server.client.delete_session(session).await?;
    }
    let n_blocks = config.objects.div_ceil(64) as u32;
    let wanted = n_blocks * config.copies.min(servers.len() as u32);
    while servers.len() > 1 {
        let known = servers[0].client.members().await?;
        let held = known.members.iter().flat_map(|member| &member.blocks).map(|it| it.n_held);
        if known.members.len() == servers.len() && held.sum::<u32>() == wanted {
            break;
        }
        ensure!(begun.elapsed() < SETTLED_WITHIN, "the blocks did not settle: {known:?}");
        tokio::time::sleep(LOOK_EVERY).await;
    }
    Ok(())
}

fn outcome(all: &[Measured]) -> Outcome {
    let mut report = Report::default();
    for of in all {
        let n = of.servers;
        report.summarise(&format!("surface_mb_{n}"), of.surface_mb);
        report.summarise(&format!("resident_mb_{n}"), of.resident_mb);
        report.summarise(&format!("p50_ms_{n}"), of.p50_ms);
        report.summarise(&format!("p99_ms_{n}"), of.p99_ms);
        if let Some(one) = all.first().filter(|one| one.servers < n) {
            report.summarise(&format!("surface_ratio_{n}"), of.surface_mb / one.surface_mb);
            report.summarise(&format!("equal_{n}"), of.equal);
        }
        report.row(of);
    }
    let points = |of: fn(&Measured) -> f64| {
        all.iter().map(|measured| (measured.servers as f64, of(measured))).collect()
    };
    let panel = |y: &str, lines: Vec<Line>| Panel {
        title: "one catalogue".to_owned(),
        x: "servers".to_owned(),
        y: y.to_owned(),
        lines,
    };
    let line = |name: &str, of| Line { name: name.to_owned(), points: points(of) };
    let memory = vec![
        line("surfaces", |measured| measured.surface_mb),
        line("whole process", |measured| measured.resident_mb),
    ];
    let time = vec![line("median", |measured| measured.p50_ms)];
    let panels = [panel("MB per server", memory), panel("ms per reading", time)];
    Outcome { report, plot: svg(&panels), pictures: Vec::new() }
}
