//! What other servers of the same store change, brought into the memory of this one.
//!
//! The store tells which records changed; each service looks again at its own. A server that has
//! its store alone hears nothing.

use palpate_store::engine::news::{Changed, News, Since};
use palpate_store::key::Space;
use tokio::sync::watch;

use crate::app::App;
use crate::cause::Cause;

/// Follows the news until the server stops.
pub(crate) async fn hear(app: App, news: News, mut stopping: watch::Receiver<bool>) {
    loop {
        let since = tokio::select! {
            since = news.next() => since,
            _ = stopping.wait_for(|stopping| *stopping) => return,
        };
        match since {
            Since::These(changed) => {
                let (of_webhooks, others): (Vec<_>, Vec<_>) =
                    changed.into_iter().partition(is_of_webhooks);
                let looking = app.clone();
                let looked = tokio::task::spawn_blocking(move || {
                    others.iter().for_each(|changed| report(look(&looking, changed)));
                });
                report(looked.await.map_err(|_| Cause::Panicked));
                for changed in &of_webhooks {
                    report(look_at_webhook(&app, changed).await);
                }
            }
            Since::Everything => {
                let looking = app.clone();
                let looked = tokio::task::spawn_blocking(move || look_at_all(&looking)).await;
                report(looked.unwrap_or(Err(Cause::Panicked)));
                report(app.webhooks.heard_all().await.map_err(Cause::from));
            }
        }
    }
}

fn report(looked: Result<(), Cause>) {
    if let Err(error) = looked {
        tracing::warn!("Cannot look at what another server changed: {error}");
    }
}

const KEY: u8 = Space::AccessKey as u8;
const ROBOT: u8 = Space::RobotHolder as u8;
const SENSOR: u8 = Space::Sensor as u8;
const CALIBRATION: u8 = Space::Calibration as u8;
const SENSOR_DAY: u8 = Space::SensorDay as u8;
const VERSION: u8 = Space::Version as u8;
const SESSION: u8 = Space::Session as u8;
const JOB: u8 = Space::Job as u8;
const WEBHOOK: u8 = Space::Webhook as u8;
const DELIVERY: u8 = Space::Delivery as u8;
const NOTICE: u8 = Space::Notice as u8;

fn is_of_webhooks(changed: &Changed) -> bool {
    matches!(changed, Changed::Id(WEBHOOK | NOTICE, _) | Changed::Nested(DELIVERY, _, _))
}

/// Looks again at one record. Blocks.
fn look(app: &App, changed: &Changed) -> Result<(), Cause> {
    match changed {
        Changed::Id(KEY, id) => Ok(app.keys.heard(*id)?),
        Changed::Name(ROBOT, robot) => Ok(app.keys.heard_robot(robot)?),
        Changed::Id(SENSOR, id) => Ok(app.sensors.heard(*id)?),
        Changed::Numbered(CALIBRATION, sensor, number) => {
            app.sensors.known().added(*sensor, u32::try_from(*number).unwrap_or(u32::MAX));
            Ok(())
        }
        Changed::Numbered(SENSOR_DAY, sensor, _) => app.sensors.health().judge(*sensor),
        Changed::Numbered(VERSION, catalogue, version) => {
            let version = u32::try_from(*version).unwrap_or(u32::MAX);
            Ok(app.catalogues.heard(*catalogue, version)?)
        }
        Changed::Id(SESSION, id) => app.sessions.heard(*id),
        Changed::Id(JOB, id) => Ok(app.jobs.heard(*id)?),
        Changed::Number(space, seq) => Ok(app.audit.heard(*space, *seq)?),
        Changed::Id(..) | Changed::Name(..) | Changed::Nested(..) | Changed::Numbered(..) => Ok(()),
    }
}

async fn look_at_webhook(app: &App, changed: &Changed) -> Result<(), Cause> {
    match changed {
        Changed::Id(WEBHOOK, id) => Ok(app.webhooks.heard(*id).await?),
        Changed::Id(_, session) => Ok(app.webhooks.heard_notice(*session)?),
        Changed::Nested(_, webhook, event) => {
            Ok(app.webhooks.heard_delivery(*webhook, *event).await?)
        }
        Changed::Number(..) | Changed::Numbered(..) | Changed::Name(..) => Ok(()),
    }
}

/// Looks again at everything. Blocks.
fn look_at_all(app: &App) -> Result<(), Cause> {
    app.keys.heard_all()?;
    app.sensors.heard_all();
    app.sensors.health().judge_all()?;
    app.sessions.heard_all()?;
    app.jobs.heard_all()?;
    Ok(app.audit.heard_all()?)
}
