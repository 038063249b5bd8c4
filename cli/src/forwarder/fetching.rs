//! Fetching: current versions of followed catalogues, and sensors with their calibrations.
//!
//! A version comes block by block. Blocks that are here already, from another version or before the
//! line broke, are not fetched again.

use std::collections::BTreeMap;
use std::time::Duration;

use palpate_client::Client;
use palpate_client::schemas::{LabelledQuery, PageQuery, Sensor};
use palpate_server::Outbox;

use super::{Pause, Trouble, note_line};

/// Pause between two looks at the central service. Chosen: a new version may come some seconds late.
const LOOK_EVERY: Duration = Duration::from_secs(10);
/// Number of sensors per request.
const PER_PAGE: u32 = 100;

/// What was fetched since the start, not to be fetched again.
#[derive(Default)]
struct Fetched {
    versions: BTreeMap<String, u32>,
    sensors: BTreeMap<String, Sensor>,
}

/// Fetches until it is dropped.
pub(super) async fn run(outbox: &Outbox, client: &Client, catalogues: &[String]) {
    let (mut pause, mut fetched) = (Pause::new(), Fetched::default());
    loop {
        match round(outbox, client, catalogues, &mut fetched).await {
            Ok(()) => {
                pause = Pause::new();
                tokio::time::sleep(LOOK_EVERY).await;
            }
            Err((error, wait)) => {
                note_line(outbox, error);
                tokio::time::sleep(pause.next(wait)).await;
            }
        }
    }
}

/// Looks at every catalogue and sensor; fails as soon as nothing gets through.
async fn round(
    outbox: &Outbox,
    client: &Client,
    catalogues: &[String],
    fetched: &mut Fetched,
) -> Result<(), (String, Option<Duration>)> {
    // A catalogue's first sessions need its sensors.
    match sensors(outbox, client, fetched).await {
        Ok(()) => {}
        Err(Trouble::Line { error, wait }) => return Err((error, wait)),
        Err(Trouble::Refused(reason)) => tracing::warn!("Cannot fetch sensors: {reason}"),
        Err(Trouble::Own(error)) => tracing::error!("Cannot take sensors over: {error}"),
    }
    for name in catalogues {
        let problem = match catalogue(outbox, client, name, fetched).await {
            Ok(()) => continue,
            Err(Trouble::Line { error, wait }) => return Err((error, wait)),
            Err(Trouble::Refused(reason)) => reason,
            Err(Trouble::Own(error)) => error.to_string(),
        };
        tracing::warn!("Cannot take catalogue {name:?} over: {problem}");
        outbox.followed(name, there(outbox, name), Some(problem));
    }
    Ok(())
}

/// The current version at the central service, as last heard.
fn there(outbox: &Outbox, name: &str) -> Option<u32> {
    let state = outbox.state();
    let mut catalogues = state.catalogues.iter();
    catalogues.find(|followed| followed.name == name).and_then(|followed| followed.current_there)
}

async fn catalogue(
    outbox: &Outbox,
    client: &Client,
    name: &str,
    fetched: &mut Fetched,
) -> Result<(), Trouble> {
    let current = client.catalogue(name).await?.current;
    outbox.answered();
    let Some(version) = current.map(|current| current.version) else {
        outbox.followed(name, None, None);
        return Ok(());
    };
    if fetched.versions.get(name) != Some(&version) {
        outbox.followed(name, Some(version), None);
        let package = client.version_package(name, version).await?;
        if let Some(mut incoming) = outbox.incoming(&package).await? {
            let missing = incoming.missing();
            tracing::info!(
                "Fetching version {version} of catalogue {name:?}: {} of {} blocks",
                missing.len(),
                package.blocks.len()
            );
            for hash in missing {
                let content = client.version_block(name, version, &hash).await?;
                outbox.answered();
                outbox.block(&mut incoming, &content).await?;
            }
            outbox.adopt(&incoming).await?;
        }
        fetched.versions.insert(name.to_owned(), version);
    }
    outbox.followed(name, Some(version), None);
    Ok(())
}

async fn sensors(outbox: &Outbox, client: &Client, fetched: &mut Fetched) -> Result<(), Trouble> {
    let mut query = LabelledQuery { limit: Some(PER_PAGE), ..LabelledQuery::default() };
    loop {
        let page = client.sensors(&query).await?;
        outbox.answered();
        for sensor in page.items {
            if fetched.sensors.get(&sensor.name) == Some(&sensor) {
                continue;
            }
            let mut page = PageQuery::default();
            loop {
                let package = client.sensor_package(&sensor.name, &page).await?;
                outbox.sensor(&package).await?;
                page.cursor = package.next_cursor;
                if page.cursor.is_none() {
                    break;
                }
            }
            fetched.sensors.insert(sensor.name.clone(), sensor);
        }
        query.cursor = page.next_cursor;
        if query.cursor.is_none() {
            return Ok(());
        }
    }
}
