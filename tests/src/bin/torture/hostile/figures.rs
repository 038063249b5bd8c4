//! Figures of the server under attack: its metrics, resources that are held, memory and cores.

use std::time::{Duration, Instant};

use palpate_tests::{memory_kib, processor_seconds};
use reqwest::{Client, Method};

use super::HONEST;
use crate::http::{client_with, send};

/// Time after which all resources held by attackers must be free.
const GIVEN_BACK: Duration = Duration::from_secs(60);

/// Size of the metrics' text, in bytes.
pub(super) async fn metrics_bytes(admin: &Client, url: &str) -> usize {
    let Ok(answer) = admin.get(format!("{url}/metrics")).send().await else { return 0 };
    answer.bytes().await.map_or(0, |bytes| bytes.len())
}

/// Reads the list of sessions on a new connection each time; the longest wait, in milliseconds.
pub(super) async fn looking(key: &str, url: &str, seconds: u32) -> f64 {
    let until = Instant::now() + Duration::from_secs(u64::from(seconds));
    let mut longest = Duration::ZERO;
    while Instant::now() < until {
        let Ok(viewer) = client_with(key) else { break };
        let asked = Instant::now();
        send(&viewer, Method::GET, format!("{url}/v1/sessions?limit=10"), None).await;
        longest = longest.max(asked.elapsed());
        tokio::time::sleep(Duration::from_millis(250)).await;
    }
    1e3 * longest.as_secs_f64()
}

/// Number of resources still held after the attacks, polled until it is 0 or the time is over.
pub(super) async fn given_back(admin: &Client, url: &str) -> anyhow::Result<u64> {
    let begun = Instant::now();
    loop {
        let metrics = admin.get(format!("{url}/metrics")).send().await?.text().await?;
        let held = held(&metrics);
        if held > 0 && begun.elapsed() >= GIVEN_BACK {
            let is_held = |line: &&str| {
                ["palpate_occupied{", "palpate_sessions_open "]
                    .iter()
                    .any(|name| line.starts_with(name))
            };
            for line in metrics.lines().filter(is_held) {
                eprintln!("still held: {line}");
            }
        }
        if held == 0 || begun.elapsed() >= GIVEN_BACK {
            return Ok(held);
        }
        tokio::time::sleep(Duration::from_secs(1)).await;
    }
}

/// Resources in use according to the metrics, without our own connection and session.
fn held(metrics: &str) -> u64 {
    let figure = |line: &str| line.rsplit_once(' ').and_then(|(_, n)| n.parse::<f64>().ok());
    let of = |name: &str| -> u64 {
        let found = metrics.lines().filter(|line| line.starts_with(name)).filter_map(figure);
        found.sum::<f64>() as u64
    };
    // Connections of honest clients idle in their pools; all come from one address.
    let connections = of("palpate_occupied{resource=\"connections\"}");
    let others = ["requests", "streams", "bodies", "answers", "snapshots"]
        .map(|resource| of(&format!("palpate_occupied{{resource=\"{resource}\"}}")));
    let sessions = of("palpate_sessions_open ").saturating_sub(1);
    others.iter().sum::<u64>() + sessions + connections.saturating_sub(OWN_CONNECTIONS)
}

/// Connections kept open by honest clients: one for each robot, and a few for set-up and
/// measurement.
const OWN_CONNECTIONS: u64 = HONEST as u64 + 8;

/// Number of cores that a process keeps busy.
pub(super) async fn cores_used(process: u32) -> anyhow::Result<f64> {
    let watched = Duration::from_secs(2);
    let before = processor_seconds(process)?;
    tokio::time::sleep(watched).await;
    Ok((processor_seconds(process)? - before) / watched.as_secs_f64())
}

/// Peak memory of a process, MB.
pub(super) fn peak_mb(process: u32) -> anyhow::Result<f64> {
    Ok(memory_kib(process, "VmHWM")? as f64 * 1024.0 / 1e6)
}
