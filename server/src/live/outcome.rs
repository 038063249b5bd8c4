//! Outcome of a session, for lists: its newest belief in short, and the robots that touched.

use std::collections::BTreeSet;

use palpate_store::database::Database;
use palpate_store::error::StoreError;
use uuid::Uuid;

use super::Tools;
use super::trace::Point;
use crate::wire::session::Outcome;

/// Number of newest readings whose robots are named.
const READINGS: u64 = 64;

/// The outcome of a session whose last reading or retraction was this revision, as far as it is
/// known: `latest` is missing when no belief was formed since.
pub(crate) fn outcome(tools: &Tools, session: Uuid, revision: u64) -> Result<Outcome, StoreError> {
    let newest = tools.traces.newest(session);
    let is_newest = |point: &Point| u64::from(point.revision) >= revision;
    let latest = newest.filter(is_newest).map(|point| point.shown());
    Ok(Outcome { latest, touched_by: touched_by(&tools.store, session, revision)? })
}

/// The robots of the newest readings of a session, sorted by name.
pub(crate) fn touched_by(
    store: &Database,
    session: Uuid,
    length: u64,
) -> Result<Vec<String>, StoreError> {
    let from = length.saturating_sub(READINGS);
    let entries = store.journal().entries(session, from, READINGS as usize)?;
    let ids = entries.iter().filter_map(|entry| entry.reading_id.as_ref());
    let robots: BTreeSet<&str> = ids.map(|id| id.robot.as_str()).collect();
    Ok(robots.into_iter().map(str::to_owned).collect())
}
