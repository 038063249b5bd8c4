//! One step: requests at a constant rate, regardless of their results.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use palpate_client::{Client, Error};
use palpate_core::rng::{Purpose, Stream};
use palpate_schemas::{BeliefDetail, BeliefQuery, ReadingsQuery};
use serde::Serialize;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::task::JoinSet;
use uuid::Uuid;

use super::memory::{Growth, Sample};
use super::operation::Mix;
use super::schedule::{Arrivals, Schedule};
use super::sessions::{Errand, Request, Sessions};
use super::tally::{Answer, Counts, Latency, OperationReport, Tally};

/// Number of sessions closed concurrently at the end.
const CLOSED_AT_ONCE: usize = 32;
/// Time limit of closing all sessions.
const CLOSING_PATIENCE: Duration = Duration::from_secs(20);

/// State shared by all steps.
pub(super) struct World {
    pub(super) client: Client,
    pub(super) sessions: Mutex<Sessions>,
    pub(super) in_flight: Arc<Semaphore>,
    pub(super) in_flight_max: usize,
    pub(super) detail: BeliefDetail,
    pub(super) polite: bool,
}

/// Plan of one step.
pub(super) struct Plan {
    pub(super) seed: u64,
    pub(super) number: u64,
    pub(super) rate: f64,
    pub(super) arrivals: Arrivals,
    pub(super) mix: Mix,
    pub(super) warmup: Duration,
    pub(super) duration: Duration,
}

/// Figures of a step.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StepReport {
    /// Requests due per second.
    pub rate: f64,
    /// Duration of the measurement, seconds.
    pub seconds: f64,
    /// Accepted requests answered during the measurement, per second.
    pub accepted_per_s: f64,
    /// Readings among them, per second.
    pub readings_per_s: f64,
    /// Results of the requests due during the measurement.
    #[serde(flatten)]
    pub counts: Counts,
    /// Latency of accepted requests; null without any.
    pub accepted_latency: Option<Latency>,
    /// Latency of refused requests; null without any.
    pub refused_latency: Option<Latency>,
    /// Figures of each kind of request.
    pub operations: Vec<OperationReport>,
    /// Largest delay of the sender, milliseconds; included in the latencies.
    pub sender_lag_max_ms: f64,
    /// Some messages of requests that were neither accepted nor refused.
    pub messages: Vec<String>,
    /// The server's memory during the measurement; null if unknown.
    pub memory: Option<Growth>,
}

impl StepReport {
    /// The report with the server's memory after the warm-up.
    pub(super) fn with_memory(self, samples: &[Sample]) -> Self {
        let measured = samples.last().map_or(0.0, |last| last.at_s - self.seconds).max(0.0);
        let samples: Vec<Sample> =
            samples.iter().copied().filter(|sample| sample.at_s >= measured).collect();
        Self { memory: Growth::of(&samples), ..self }
    }
}

/// Shared records of a step's requests.
struct Notes {
    tally: Mutex<Tally>,
    from: Instant,
    to: Instant,
}

/// Runs a step and waits for its last answers.
pub(super) async fn run(world: &Arc<World>, plan: &Plan) -> anyhow::Result<StepReport> {
    let mut schedule = Schedule::new(plan.rate, plan.arrivals, plan.seed, plan.number);
    let mut choice = Stream::new(plan.seed, Purpose::Arrivals, 2 * plan.number + 1);
    let begun = Instant::now();
    let from = begun + plan.warmup;
    let to = from + plan.duration;
    let notes = Arc::new(Notes { tally: Mutex::new(Tally::new()?), from, to });
    loop {
        let due = begun + schedule.next();
        if due >= to {
            break;
        }
        tokio::time::sleep_until(due.into()).await;
        let wanted = plan.mix.draw(&mut choice);
        let is_measured = due >= from;
        let Ok(permit) = Arc::clone(&world.in_flight).try_acquire_owned() else {
            if is_measured {
                lock(&notes.tally).not_sent(wanted);
            }
            continue;
        };
        let Some(errand) = lock(&world.sessions).take(wanted, due) else {
            if is_measured {
                lock(&notes.tally).held_back(wanted);
            }
            continue;
        };
        if is_measured {
            lock(&notes.tally).sent(errand.operation, due.elapsed());
        }
        tokio::spawn(send(Arc::clone(world), Arc::clone(&notes), errand, due, permit));
    }
    tokio::time::sleep_until(to.into()).await;
    let in_window = lock(&notes.tally).in_window();
    // The client gives up on every request eventually, so this ends.
    let all = world.in_flight.acquire_many(world.in_flight_max as u32).await;
    drop(all);
    report(plan, &lock(&notes.tally), in_window)
}

/// Sends one request and records its result.
async fn send(
    world: Arc<World>,
    notes: Arc<Notes>,
    errand: Errand,
    due: Instant,
    permit: OwnedSemaphorePermit,
) {
    let (robot, operation) = (errand.robot, errand.operation);
    let sent = ask(&world.client, world.detail, errand.request).await;
    let now = Instant::now();
    let (answer, created) = match sent {
        Ok(created) => (Answer::Accepted, created),
        Err(error) => (Answer::of(&error), None),
    };
    let waits_until = match &answer {
        Answer::Refused { retry_after: Some(wish), .. } if world.polite => Some(now + *wish),
        _ => None,
    };
    lock(&world.sessions).answered(robot, operation, &answer, created, waits_until);
    let mut tally = lock(&notes.tally);
    if due >= notes.from {
        tally.answered(operation, &answer, now - due);
    }
    if answer == Answer::Accepted && (notes.from..notes.to).contains(&now) {
        tally.accepted_in_window(operation);
    }
    drop(tally);
    drop(permit);
}

/// Makes the call; returns the new session, if any.
async fn ask(
    client: &Client,
    detail: BeliefDetail,
    request: Request,
) -> Result<Option<Uuid>, Error> {
    match request {
        Request::Create(session) => {
            return Ok(Some(client.create_session(&session).await?.id));
        }
        Request::Reading(session, readings) => {
            let query = ReadingsQuery { belief: Some(detail) };
            client.add_readings(session, &readings, query).await?;
        }
        Request::Belief(session) => {
            client.belief(session, BeliefQuery::default()).await?;
        }
        Request::NextTouches(session, question) => {
            client.next_touches(session, &question).await?;
        }
        Request::Close(session) => {
            client.close_session(session).await?;
        }
    }
    Ok(None)
}

/// Closes the open sessions; those that cannot be closed in time stay open.
pub(super) async fn close_all(world: &World) {
    let open = lock(&world.sessions).open();
    let closing = async {
        for some in open.chunks(CLOSED_AT_ONCE) {
            let mut under_way = JoinSet::new();
            for session in some {
                let (client, session) = (world.client.clone(), *session);
                under_way.spawn(async move { client.close_session(session).await });
            }
            under_way.join_all().await;
        }
    };
    // A busy server need not answer these.
    let _ = tokio::time::timeout(CLOSING_PATIENCE, closing).await;
}

fn report(plan: &Plan, tally: &Tally, in_window: [u64; 2]) -> anyhow::Result<StepReport> {
    let seconds = plan.duration.as_secs_f64();
    let [accepted, readings] = in_window;
    Ok(StepReport {
        rate: plan.rate,
        seconds,
        accepted_per_s: accepted as f64 / seconds,
        readings_per_s: readings as f64 / seconds,
        counts: tally.total(),
        accepted_latency: tally.accepted_latency()?,
        refused_latency: tally.refused_latency(),
        operations: tally.operations(),
        sender_lag_max_ms: tally.lag_max().as_secs_f64() * 1e3,
        messages: tally.messages(),
        memory: None,
    })
}

fn lock<T>(shared: &Mutex<T>) -> MutexGuard<'_, T> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}
