//! Processor time of a reading: of the whole server, of an echo of the same bodies, and of the
//! recogniser called directly.
//!
//! Robots share one thread, whose time is subtracted from that of the process; the rest is the
//! server's, with its storage and its background work.

use std::sync::Arc;

use anyhow::Context as _;
use palpate_client::{Client, ClientOptions};
use palpate_core::reading::Reading;
use palpate_core::sensor::SensorDescription;
use palpate_recogniser::options::SurfaceOptions;
use palpate_recogniser::train::SurfaceConfig;
use palpate_schemas::{AddReadings, BeliefDetail, CreateSession, ReadingsQuery};
use palpate_sim::shapes;
use serde::Serialize;

use super::echo::Echo;
use super::{CATALOGUE, READINGS_PER_SESSION, ServerThroughput, Setting, measure, numbered};
use crate::cpu_time::{process_seconds, thread_seconds};
use crate::object_sessions::{Recogniser, Sessions};
use crate::objects;
use crate::own_server::OwnServer;
use crate::report::{Progress, Report};
use crate::trained::train_calibrated;

/// Robots whose requests are measured, as in the largest setting.
const ROBOTS: usize = 64;

/// One part and its processor time.
#[derive(Serialize)]
struct Cost {
    part: &'static str,
    cpu_ms_per_reading: f64,
}

/// Adds the processor time of each part; nothing where the system does not tell it.
pub(super) async fn report(
    config: &ServerThroughput,
    server: &OwnServer,
    readings: &Arc<Vec<Vec<Reading>>>,
    report: &mut Report,
    progress: Progress<'_>,
) -> anyhow::Result<()> {
    if process_seconds().is_none() {
        return Ok(());
    }
    progress("processor time", 0, 6);
    let echo = echo(&server.client, &readings[0]).await?;
    let single = |belief| Setting { robots: ROBOTS, batch: 1, belief };
    let n = 2 * config.readings;
    let mut state = |part: &'static str, cpu_ms_per_reading: f64| {
        report.row(Cost { part, cpu_ms_per_reading });
        report.summarise(&format!("cpu_ms_{part}"), cpu_ms_per_reading);
        cpu_ms_per_reading
    };
    let cost = |address: String, setting| cost(address, readings.clone(), setting, n);
    let echoed = state("echo", cost(echo.address(), single(BeliefDetail::Full)).await?);
    drop(echo);
    progress("processor time", 1, 6);
    let full = state("full", cost(server.address(), single(BeliefDetail::Full)).await?);
    progress("processor time", 2, 6);
    state("top", cost(server.address(), single(BeliefDetail::Top)).await?);
    progress("processor time", 3, 6);
    state("none", cost(server.address(), single(BeliefDetail::None)).await?);
    progress("processor time", 4, 6);
    let batched = Setting { batch: super::BATCH, ..single(BeliefDetail::Full) };
    state("batch_32", cost(server.address(), batched).await?);
    progress("processor time", 5, 6);
    let (alone, in_turn) = recogniser(config, readings, progress)?;
    let recogniser = state("recogniser", alone);
    state("recogniser_in_turn", in_turn);
    report.summarise("cpu_ratio", full / (echoed + recogniser));
    report.summarise("cpu_ratio_in_turn", full / (echoed + in_turn));
    Ok(())
}

/// An echo that answers what the server answers to the first reading of a session.
async fn echo(client: &Client, readings: &[Reading]) -> anyhow::Result<Echo> {
    let create =
        CreateSession { catalogue: Some(CATALOGUE.to_owned()), ..CreateSession::default() };
    let session = client.create_session(&create).await?;
    let body = AddReadings { readings: vec![numbered(&readings[0], 0, 0)] };
    let query = ReadingsQuery { belief: Some(BeliefDetail::Full) };
    let added = client.add_readings(session.id, &body, query).await?;
    client.close_session(session.id).await?;
    Echo::start(&session, &added).await
}

/// The process's time per reading without that of the robots, milliseconds.
async fn cost(
    address: String,
    readings: Arc<Vec<Vec<Reading>>>,
    setting: Setting,
    n: usize,
) -> anyhow::Result<f64> {
    let robots = move || {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
        runtime.block_on(async {
            let client = Client::with_options(&address, ClientOptions::default())?;
            // Connections are open, and the server has warmed up.
            measure(&client, &readings, setting, setting.robots * READINGS_PER_SESSION).await?;
            let seconds =
                || process_seconds().zip(thread_seconds()).map(|(all, robots)| all - robots);
            let begun = seconds().context("the process has a time")?;
            let posted = measure(&client, &readings, setting, n).await?.posted;
            let ended = seconds().context("the process has a time")?;
            Ok((ended - begun) * 1e3 / posted as f64)
        })
    };
    tokio::task::spawn_blocking(robots).await?
}

/// Time per reading of the recogniser with the same objects, milliseconds: of one session after the
/// other, and of as many in turn as there are robots.
fn recogniser(
    config: &ServerThroughput,
    readings: &[Vec<Reading>],
    progress: Progress<'_>,
) -> anyhow::Result<(f64, f64)> {
    let sensor = SensorDescription::digitacts_6x6();
    let objects = objects::generated(&shapes::NAMES, shapes::LARGEST_DIMENSION)?;
    let n = config.train_readings as usize;
    let train = objects::touch_all(&objects, &sensor, n, config.seed, progress)?;
    let symmetries = objects::symmetries(&objects);
    let surface = SurfaceConfig::default();
    let model = train_calibrated(&train, &symmetries, &sensor, &surface, config.seed)?;
    let sessions =
        Sessions::undisturbed(&sensor, readings, &symmetries, config.seed, READINGS_PER_SESSION);
    let recogniser = Recogniser::Surface { model, options: SurfaceOptions::default() };
    let n_sessions = (config.readings / READINGS_PER_SESSION).max(objects.len());
    let played = sessions.play(&recogniser, objects.len(), n_sessions, progress)?;
    let alone = played.cpu_ms.context("a thread has a time")?;
    let in_turn = sessions.play_in_turn(&recogniser, objects.len(), ROBOTS)?;
    Ok((alone, in_turn.context("a thread has a time")?))
}
