//! Load as a fleet makes it: an open loop, in which requests come when they are due, whatever
//! became of those before.
//!
//! Latency is counted from the moment a request was due, so a server that stalls, or a sender
//! that falls behind, shows in it (no coordinated omission). Whatever is due and cannot be sent
//! is counted. Every choice comes from a seed.
//! Not here: what is typed and printed (`palpate load`).

mod memory;
mod operation;
mod schedule;
mod tally;
pub mod wire;
mod touches;
mod prepare;
mod sessions;
mod step;
mod report;
mod picture;

use std::sync::Arc;
use std::time::Duration;

use palpate_client::Client;
use palpate_schemas::{BeliefDetail, Method};
use tokio::sync::Semaphore;

pub use memory::{Growth, MemorySource, Sample};
pub use operation::{Mix, MixError, Operation};
pub use picture::picture;
pub use prepare::prepare;
pub use report::{Bounds, LoadReport, Verdict};
pub use schedule::Arrivals;
pub use step::StepReport;
pub use tally::{Counts, Latency, OperationReport};
pub use touches::{SENSOR, Touches};

use memory::watch;
use sessions::Sessions;
use step::{Plan, World};

/// Hears how far a preparation is: what it does, steps done, steps in all.
pub type Progress<'a> = &'a (dyn Fn(&str, usize, usize) + Sync);

/// Requests to send, and their rate.
#[derive(Clone, Debug)]
pub struct LoadConfig {
    /// The seed of everything random.
    pub seed: u64,
    /// The catalogue that sessions recognise with.
    pub catalogue: String,
    /// How they recognise; the server's choice when not given.
    pub method: Option<Method>,
    /// How much of the belief is answered to a reading.
    pub belief: BeliefDetail,
    /// Requests a second, one step after the other.
    pub rates: Vec<f64>,
    /// How requests follow each other.
    pub arrivals: Arrivals,
    /// Measured part of each step.
    pub duration: Duration,
    /// Part of each step before that, which is not measured.
    pub warmup: Duration,
    /// Long step at overload after the others.
    pub soak: Option<Soak>,
    /// How many robots there are, each with one session at a time.
    pub sessions: usize,
    /// Readings after which a robot closes its session and begins another one.
    pub readings_per_session: u32,
    /// Mix of requests.
    pub mix: Mix,
    /// How many requests may be under way; what is due beyond is counted as not sent.
    pub in_flight_max: usize,
    /// Whether a robot that was told when to come back waits until then.
    pub polite: bool,
}

/// A long step at overload, to see whether memory grows.
#[derive(Clone, Copy, Debug)]
pub struct Soak {
    /// Its duration.
    pub duration: Duration,
    /// At which multiple of the largest rate of accepted requests that a step has shown.
    pub factor: f64,
}

/// Runs all steps against a server. `client` must not repeat requests by itself; `show` hears
/// of each step's end.
///
/// # Errors
/// When the histograms cannot be made, or the sender panicked. What the server refuses or
/// breaks is counted, not an error.
pub async fn run(
    config: &LoadConfig,
    client: &Client,
    touches: Touches,
    memory: &MemorySource,
    show: impl Fn(&StepReport),
) -> anyhow::Result<LoadReport> {
    let world = Arc::new(World {
        client: client.clone(),
        sessions: Sessions::new(config, touches).into(),
        in_flight: Arc::new(Semaphore::new(config.in_flight_max)),
        in_flight_max: config.in_flight_max,
        detail: config.belief,
        polite: config.polite,
    });
    let mut steps = Vec::with_capacity(config.rates.len());
    for (number, rate) in config.rates.iter().enumerate() {
        let plan = plan(config, number as u64, *rate, config.duration);
        let (step, samples) = watch(client, memory, step::run(&world, &plan)).await;
        let step = step?.with_memory(&samples);
        show(&step);
        steps.push(step);
    }
    let soak = match &config.soak {
        None => None,
        Some(soak) => {
            let rate = soak.factor * most_accepted(&steps);
            let plan = plan(config, config.rates.len() as u64, rate, soak.duration);
            let (step, samples) = watch(client, memory, step::run(&world, &plan)).await;
            let step = step?.with_memory(&samples);
            show(&step);
            Some(step)
        }
    };
    step::close_all(&world).await;
    Ok(LoadReport::new(config, steps, soak))
}

fn plan(config: &LoadConfig, number: u64, rate: f64, duration: Duration) -> Plan {
    Plan {
        seed: config.seed,
        number,
        rate,
        arrivals: config.arrivals,
        mix: config.mix,
        warmup: config.warmup,
        duration,
    }
}

/// The most requests a second that were accepted, or else the lowest rate that was tried.
fn most_accepted(steps: &[StepReport]) -> f64 {
    let accepted = steps.iter().map(|step| step.accepted_per_s).fold(0.0, f64::max);
    if accepted > 0.0 { accepted } else { steps.first().map_or(1.0, |step| step.rate) }
}
