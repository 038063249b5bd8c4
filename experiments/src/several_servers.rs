//! The same readings through one server with a folder and through servers that share a NATS cluster.
//!
//! The cluster runs already; its address is an argument. The built-in objects are trained on the
//! folder and on the cluster, and 64 robots post single readings in a closed loop, as in
//! `server-throughput`: first to a server with a folder, then to one, two and three servers on the
//! cluster, with as many robots each. Robots, servers and, in the recorded run, the cluster share
//! one machine, so that more servers cannot be faster here: the experiment shows what a commit on
//! the cluster costs, in time and in processor time of this process (robots included, the cluster
//! not).

use std::sync::Arc;

use clap::Args;
use hdrhistogram::Histogram;
use palpate_client::Client;
use palpate_core::reading::Reading;
use palpate_schemas::BeliefDetail;
use palpate_sim::plot::{Line, Panel, svg};
use serde::Serialize;

use crate::arguments::{count, defaults};
use crate::cpu_time::process_seconds;
use crate::own_server::{OwnServer, block_on};
use crate::report::{Outcome, Progress, Report};
use crate::server_throughput::{Posted, ServerThroughput, Setting, measure, prepare};

/// Robots of all servers together.
const ROBOTS: usize = 64;
/// Largest number of servers on the cluster.
const SERVERS_MAX: usize = 3;

/// Arguments of `several-servers`.
#[derive(Args, Clone, Debug, Serialize)]
pub struct SeveralServers {
    /// Address of a NATS cluster without a stream of the name; `tests/nats install` prints the
    /// program of a server.
    #[arg(long, value_name = "URL")]
    pub nats: String,
    /// Seed of everything random.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Training readings per object.
    #[arg(long, default_value_t = 300)]
    pub train_readings: u32,
    /// Readings posted in each setting.
    #[arg(long, default_value_t = 1_280, value_parser = count)]
    pub readings: usize,
}

/// What was measured of some servers.
#[derive(Serialize)]
struct Measured {
    store: &'static str,
    servers: usize,
    robots: usize,
    readings_per_second: f64,
    p50_ms: f64,
    p99_ms: f64,
    cpu_ms_per_reading: Option<f64>,
}

/// Runs the experiment against servers of its own.
///
/// # Errors
/// When the cluster cannot be reached or used, a server refuses something, or training fails.
pub fn run(config: &SeveralServers, progress: Progress<'_>) -> anyhow::Result<Outcome> {
    block_on(async {
        let mut all = Vec::new();
        let alone = vec![OwnServer::start().await?];
        let readings = Arc::new(trained(config, &alone[0].client, progress).await?);
        all.extend(measured(config, "sled", &alone, &readings).await?);
        stop(alone).await;
        let mut servers = vec![OwnServer::start_on(&config.nats).await?];
        trained(config, &servers[0].client, progress).await?;
        for n in 1..=SERVERS_MAX {
            if n > 1 {
                servers.push(OwnServer::start_on(&config.nats).await?);
            }
            progress("servers on the cluster", n, SERVERS_MAX);
            all.extend(measured(config, "nats", &servers, &readings).await?);
        }
        stop(servers).await;
        Ok(outcome(&all))
    })
}

async fn stop(servers: Vec<OwnServer>) {
    for server in servers {
        server.stop().await;
    }
}

async fn trained(
    config: &SeveralServers,
    client: &Client,
    progress: Progress<'_>,
) -> anyhow::Result<Vec<Vec<Reading>>> {
    let training =
        ServerThroughput { seed: config.seed, train_readings: config.train_readings, ..defaults() };
    prepare(&training, client, progress).await
}

/// One robot alone, then all robots, on the servers in equal parts.
async fn measured(
    config: &SeveralServers,
    store: &'static str,
    servers: &[OwnServer],
    readings: &Arc<Vec<Vec<Reading>>>,
) -> anyhow::Result<[Measured; 2]> {
    // A server reads catalogue and sensors when it is first asked.
    post(&servers.iter().collect::<Vec<_>>(), servers.len(), servers.len() * 10, readings).await?;
    let alone = posted(store, &servers[..1], 1, config.readings / 8, readings).await?;
    let together = posted(store, servers, ROBOTS, config.readings, readings).await?;
    Ok([alone, Measured { servers: servers.len(), ..together }])
}

async fn posted(
    store: &'static str,
    servers: &[OwnServer],
    robots: usize,
    n: usize,
    readings: &Arc<Vec<Vec<Reading>>>,
) -> anyhow::Result<Measured> {
    let begun = process_seconds();
    let Posted { posted, seconds, latency } =
        post(&servers.iter().collect::<Vec<_>>(), robots, n, readings).await?;
    let cpu = process_seconds().zip(begun).map(|(end, begun)| end - begun);
    let ms = |quantile: f64| latency.value_at_quantile(quantile) as f64 / 1e3;
    Ok(Measured {
        store,
        servers: servers.len(),
        robots,
        readings_per_second: posted as f64 / seconds,
        p50_ms: ms(0.5),
        p99_ms: ms(0.99),
        cpu_ms_per_reading: cpu.map(|seconds| seconds * 1e3 / posted as f64),
    })
}

/// Posts about `n` readings by robots in equal parts.
async fn post(
    servers: &[&OwnServer],
    robots: usize,
    n: usize,
    readings: &Arc<Vec<Vec<Reading>>>,
) -> anyhow::Result<Posted> {
    let parts = servers.iter().enumerate().map(|(index, server)| {
        let share = |all: usize| all * (index + 1) / servers.len() - all * index / servers.len();
        let setting = Setting { robots: share(robots), batch: 1, belief: BeliefDetail::Full };
        let (client, readings, n) = (server.client.clone(), Arc::clone(readings), share(n));
        tokio::spawn(async move { measure(&client, &readings, setting, n).await })
    });
    let mut all = Posted { posted: 0, seconds: 0.0, latency: Histogram::new(3)? };
    for part in parts.collect::<Vec<_>>() {
        let Posted { posted, seconds, latency } = part.await??;
        all.posted += posted;
        all.seconds = all.seconds.max(seconds);
        all.latency.add(latency)?;
    }
    Ok(all)
}

fn outcome(all: &[Measured]) -> Outcome {
    let mut report = Report::default();
    let (alone, together): (Vec<&Measured>, Vec<&Measured>) =
        all.iter().partition(|measured| measured.robots == 1);
    let mut state = |of: &Measured, key: String, value: Option<f64>| {
        let servers = if of.store == "sled" { String::new() } else { format!("_{}", of.servers) };
        if let Some(value) = value {
            report.summarise(&format!("{key}_{}{servers}", of.store), value);
        }
    };
    for of in &together {
        state(of, "readings_per_second".to_owned(), Some(of.readings_per_second));
        state(of, "p50_ms".to_owned(), Some(of.p50_ms));
        state(of, "p99_ms".to_owned(), Some(of.p99_ms));
        state(of, "cpu_ms".to_owned(), of.cpu_ms_per_reading);
        if let Some(sled) = together.first().filter(|first| first.store != of.store) {
            let rate = of.readings_per_second / sled.readings_per_second;
            state(of, "rate_ratio".to_owned(), Some(rate));
            state(of, "p99_ratio".to_owned(), Some(of.p99_ms / sled.p99_ms));
        }
    }
    // One robot alone always posts to the first server.
    for of in alone.iter().take(2) {
        state(of, "p50_ms_of_one_robot".to_owned(), Some(of.p50_ms));
    }
    let points = |store: &str| {
        let of_store = together.iter().filter(|of| of.store == store);
        of_store.map(|of| (of.servers as f64, of.readings_per_second)).collect()
    };
    let lines =
        ["sled", "nats"].map(|store| Line { name: store.to_owned(), points: points(store) });
    let panel = Panel {
        title: "64 robots".to_owned(),
        x: "servers".to_owned(),
        y: "readings per second".to_owned(),
        lines: lines.into(),
    };
    for of in all {
        report.row(of);
    }
    Outcome { report, plot: svg(&[panel]), pictures: Vec::new() }
}
