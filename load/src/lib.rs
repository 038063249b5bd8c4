//! Load of a fleet: an open loop, in which requests are sent when due, regardless of earlier ones.
//!
//! Latency counts from the moment at which a request was due, so it includes stalls of the
//! server and delays of the sender (no coordinated omission). Requests that are due and
//! cannot be sent are counted. A seed determines every choice. Not here: command line and
//! output (`palpate load`).

mod memory;
mod operation;
mod picture;
mod prepare;
mod report;
mod schedule;
mod sessions;
mod step;
mod tally;
mod touches;
pub mod wire;

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

/// Progress function of a preparation: receives the stage, finished steps and all steps.
pub type Progress<'a> = &'a (dyn Fn(&str, usize, usize) + Sync);

/// Requests to send, and their rate.
#[derive(Clone, Debug)]
pub struct LoadConfig {
    /// Seed of all randomness.
    pub seed: u64,
    /// The sessions' catalogue.
    pub catalogue: String,
    /// Recognition method of the sessions; the server's choice if not given.
    pub method: Option<Method>,
    /// Detail of the belief in answers to readings.
    pub belief: BeliefDetail,
    /// Requests per second, one step after the other.
    pub rates: Vec<f64>,
    /// Distribution of the times of requests.
    pub arrivals: Arrivals,
    /// Measured part of each step.
    pub duration: Duration,
    /// Part of each step before that, which is not measured.
    pub warmup: Duration,
    /// Long step at overload after the others.
    pub soak: Option<Soak>,
    /// Number of robots, each with one session at a time.
    pub sessions: usize,
    /// Readings after which a robot closes its session and starts another one.
    pub readings_per_session: u32,
    /// Mix of requests.
    pub mix: Mix,
    /// Maximum number of concurrent requests; further ones that are due count as not sent.
    pub in_flight_max: usize,
    /// Whether a robot waits as long as `Retry-After` says.
    pub polite: bool,
}

/// A long step at overload, to see whether memory grows.
#[derive(Clone, Copy, Debug)]
pub struct Soak {
    /// Its duration.
    pub duration: Duration,
    /// Rate of the soak, as a multiple of the largest accepted rate of a step.
    pub factor: f64,
}

/// Runs all steps against a server. `client` must not repeat requests by itself; `show` is
/// called at the end of each step.
///
/// # Errors
/// When the histograms cannot be created, or the sender panicked. Refusals and failures of the server
/// are counted, not errors.
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

/// The largest accepted rate of a step, or else the lowest rate that was tried.
fn most_accepted(steps: &[StepReport]) -> f64 {
    let accepted = steps.iter().map(|step| step.accepted_per_s).fold(0.0, f64::max);
    if accepted > 0.0 { accepted } else { steps.first().map_or(1.0, |step| step.rate) }
}
