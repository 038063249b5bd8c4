//! How long a restart takes until every open session's belief is answered again.
//!
//! Sessions of the default method are filled over REST with touches of the built-in objects, and
//! their beliefs are noted. Then the server is started anew on the same folder by the caller,
//! and several clients ask for all beliefs: each must be the same, to the last bit. Client and
//! server share the machine.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use hdrhistogram::Histogram;
use palpate_client::Client;
use palpate_core::pose::Pose;
use palpate_core::rng::{Purpose, Stream};
use palpate_schemas::{
    AddReadings, Belief, BeliefDetail, BeliefQuery, CreateSession, ReadingsQuery,
};
use serde_json::json;

use crate::plot::{Line, Panel, svg};
use crate::report::{Outcome, Progress, Report};
use crate::server_throughput::{CATALOGUE, ServerThroughput, numbered, prepare};

/// How many clients ask at the same time.
const CLIENTS: usize = 8;

/// What to run.
#[derive(Clone, Debug)]
pub struct Restart {
    /// The seed of everything random.
    pub seed: u64,
    /// Open sessions.
    pub sessions: usize,
    /// Readings of each.
    pub readings: usize,
}

/// Sessions that were filled before the restart.
#[derive(Debug)]
pub struct Filled {
    /// What each believed.
    beliefs: Arc<Vec<Belief>>,
    /// How long the filling took, seconds.
    seconds: f64,
}

/// Trains the built-in objects and fills the sessions.
///
/// # Errors
/// When the server refuses something, or training fails.
pub async fn fill(
    config: &Restart,
    client: &Client,
    progress: Progress<'_>,
) -> anyhow::Result<Filled> {
    let training = ServerThroughput { seed: config.seed, ..ServerThroughput::default() };
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

/// Asks the server that was started anew for all beliefs. `start_seconds` is how long the
/// start took until it listened.
///
/// # Errors
/// When the server refuses something.
pub async fn ask(
    config: &Restart,
    filled: Filled,
    start_seconds: f64,
    client: &Client,
    command: String,
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
    let mut report = Report::new("restart", command, config.seed);
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
    report.row(figures.iter().map(|(name, value)| (*name, json!(value))).collect());
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
