//! Time from a restart until the beliefs of all open sessions are answered again.
//!
//! Sessions of the default method are filled over REST with touches of the built-in objects, and
//! their beliefs are noted. Then the server is started again on the same folder, and several
//! clients request all beliefs, which must equal the noted ones bit for bit. Client and server
//! share the machine.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use clap::Args;
use hdrhistogram::Histogram;
use palpate_client::Client;
use palpate_core::pose::Pose;
use palpate_core::rng::{Purpose, Stream};
use palpate_schemas::{
    AddReadings, Belief, BeliefDetail, BeliefQuery, CreateSession, ReadingsQuery,
};
use palpate_sim::plot::{Line, Panel, svg};
use serde::Serialize;

use crate::arguments::{count, defaults};
use crate::own_server::{OwnServer, block_on};
use crate::report::{Outcome, Progress, Report};
use crate::server_throughput::{CATALOGUE, ServerThroughput, numbered, prepare};

/// Number of concurrent clients.
const CLIENTS: usize = 8;

/// Arguments of `restart`.
#[derive(Args, Clone, Debug, Serialize)]
pub struct Restart {
    /// Seed of everything random.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Open sessions.
    #[arg(long, default_value_t = 1_000, value_parser = count)]
    pub sessions: usize,
    /// Readings of each, at most 1000.
    #[arg(long, default_value_t = 50, value_parser = count)]
    pub readings: usize,
}

/// Sessions filled before the restart.
struct Filled {
    /// Belief of each session before the restart.
    beliefs: Arc<Vec<Belief>>,
    /// Time of the filling, seconds.
    seconds: f64,
}

/// Fills a server of its own, starts it again and requests the beliefs of all sessions.
///
/// # Errors
/// When the server cannot be started or refuses something, or training fails.
pub fn run(config: &Restart, progress: Progress<'_>) -> anyhow::Result<Outcome> {
    block_on(async {
        let server = OwnServer::start().await?;
        let filled = fill(config, &server.client, progress).await?;
        let (server, start_seconds) = server.restart().await?;
        let outcome = ask(config, filled, start_seconds, &server.client).await;
        server.stop().await;
        outcome
    })
}

/// Trains the built-in objects and fills the sessions.
async fn fill(config: &Restart, client: &Client, progress: Progress<'_>) -> anyhow::Result<Filled> {
    let training = ServerThroughput { seed: config.seed, ..defaults() };
    let readings = prepare(&training, client, progress).await?;
    let begun = Instant::now();
    let mut beliefs = Vec::with_capacity(config.sessions);
    for index in 0..config.sessions {
        progress("filling sessions", index, config.sessions);
        let mut stream = Stream::new(config.seed, Purpose::ObjectPose, index as u64);
        let touched = &readings[index % readings.len()];
        let pose = Pose::from_parts(stream.rotation(), 0.2 * stream.direction());
        let create =
            CreateSession { catalogue: Some(CATALOGUE.to_owned()), ..CreateSession::default() };
        let session = client.create_session(&create).await?.id;
        let body = AddReadings {
            readings: (0..config.readings)
                .map(|seq| {
                    let reading = touched[stream.index(touched.len())].moved_by(pose);
                    numbered(&reading, 0, seq)
                })
                .collect(),
        };
        let query = ReadingsQuery { belief: Some(BeliefDetail::Full) };
        beliefs.extend(client.add_readings(session, &body, query).await?.belief);
    }
    Ok(Filled { beliefs: Arc::new(beliefs), seconds: begun.elapsed().as_secs_f64() })
}

/// Requests all beliefs from the restarted server. `start_seconds` is the time until it listened.
async fn ask(
    config: &Restart,
    filled: Filled,
    start_seconds: f64,
    client: &Client,
) -> anyhow::Result<Outcome> {
    let begun = Instant::now();
    let next = Arc::new(AtomicUsize::new(0));
    let askers: Vec<_> = (0..CLIENTS)
        .map(|_| {
            let (client, next) = (client.clone(), Arc::clone(&next));
            let beliefs = Arc::clone(&filled.beliefs);
            tokio::spawn(async move {
                let (mut latency, mut differ) = (Histogram::<u64>::new(3)?, 0usize);
                while let Some(before) = beliefs.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let asked = Instant::now();
                    let after = client.belief(before.session, BeliefQuery::default()).await?;
                    latency.record(asked.elapsed().as_micros() as u64)?;
                    differ += usize::from(after != *before);
                }
                anyhow::Ok((latency, differ))
            })
        })
        .collect();
    let (mut latency, mut differ) = (Histogram::<u64>::new(3)?, 0);
    for asker in askers {
        let (of_one, differing) = asker.await??;
        latency.add(of_one)?;
        differ += differing;
    }
    let seconds = begun.elapsed().as_secs_f64();
    let mut report = Report::default();
    let quantile = |quantile: f64| latency.value_at_quantile(quantile) as f64 / 1e3;
    let figures = [
        ("sessions", filled.beliefs.len() as f64),
        ("readings_per_session", config.readings as f64),
        ("fill_seconds", filled.seconds),
        ("start_seconds", start_seconds),
        ("answer_all_seconds", seconds),
        ("p50_ms", quantile(0.5)),
        ("p99_ms", quantile(0.99)),
        ("beliefs_differ", differ as f64),
    ];
    report.row(BTreeMap::from(figures));
    for (name, value) in figures {
        report.summarise(name, value);
    }
    let quantiles = [0.01, 0.1, 0.25, 0.5, 0.75, 0.9, 0.99];
    let points = quantiles.iter().map(|share| (100.0 * share, quantile(*share))).collect();
    let panel = Panel {
        title: "waiting for a belief after a restart".to_owned(),
        x: "percent of sessions".to_owned(),
        y: "ms".to_owned(),
        lines: vec![Line { name: format!("{CLIENTS} clients"), points }],
    };
    Ok(Outcome { report, plot: svg(&[panel]), pictures: Vec::new() })
}
