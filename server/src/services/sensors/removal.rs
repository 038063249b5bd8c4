//! Removal of an unneeded sensor.
//!
//! A sensor is needed while a kept object or session has a reading of it, and while an
//! unfinished training touches with it. The search through all readings takes time, in which
//! more may come: a sensor without any is closed first, then searched for again.

use std::sync::Arc;

use palpate_store::database::Database;
use palpate_store::entity::{Job, Sensor};
use palpate_store::journal::{Event, Journal};
use uuid::Uuid;

use super::Sensors;
use crate::cause::Cause;
use crate::compute::Pool;

/// Number of records per read.
const PER_PAGE: usize = 256;

/// Reopens a sensor unless it is removed.
struct Closed<'a> {
    sensors: &'a Sensors,
    id: Uuid,
}

impl Drop for Closed<'_> {
    fn drop(&mut self) {
        self.sensors.closed.remove(&self.id);
    }
}

impl Sensors {
    /// Read-locked while readings, or a training with a sensor, are being stored.
    pub(crate) async fn using(&self) -> tokio::sync::OwnedRwLockReadGuard<()> {
        Arc::clone(&self.using).read_owned().await
    }

    /// Removes a sensor that is not needed, with its calibrations.
    pub(crate) async fn remove(&self, reference: &str, pool: &Pool) -> Result<(), Cause> {
        let sensor = self.get(reference)?;
        if sensor.preset.as_ref() == Some(&sensor.name) {
            let what = format!("sensor {:?}", sensor.name);
            return Err(Cause::Needed { what, by: "every server has its preset".to_owned() });
        }
        self.expect_unused(&sensor, pool).await?;
        // From here on it accepts no readings; those being stored are awaited.
        self.closed.insert(sensor.id);
        let _closed = Closed { sensors: self, id: sensor.id };
        drop(self.using.write().await);
        self.expect_unused(&sensor, pool).await?;
        self.store.essential().remove_sensor(sensor.id).await?;
        self.known.forget(sensor.id);
        self.health.forget(sensor.id);
        tracing::info!(sensor.id = %sensor.id, "Removed sensor {:?}", sensor.name);
        Ok(())
    }

    /// Refuses if the sensor is needed. Searches on a thread of the pool.
    async fn expect_unused(&self, sensor: &Sensor, pool: &Pool) -> Result<(), Cause> {
        let (store, id, created) = (self.store.clone(), sensor.id, sensor.created_at_ms);
        let needs = move || needs(&store, id, created);
        match pool.place()?.run_long(needs).await?? {
            None => Ok(()),
            Some(by) => Err(Cause::Needed { what: format!("sensor {:?}", sensor.name), by }),
        }
    }
}

/// The user of a sensor that exists since `created_at_ms`, if any. Blocks.
fn needs(store: &Database, sensor: Uuid, created_at_ms: u64) -> Result<Option<String>, Cause> {
    let jobs = store.jobs().list_whole(None, usize::MAX - 1)?.items;
    let touches = |job: &&Job| !job.state.is_final() && job.request.contains(&sensor.to_string());
    if let Some(job) = jobs.iter().find(touches) {
        return Ok(Some(format!("job {} touches with it: cancel it first", job.id)));
    }
    // An object's readings are all of one sensor.
    for object in store.objects().all()? {
        let first = store.training().entry(object.id, 0)?;
        if first.is_some_and(|entry| is_of(&entry.event, sensor)) {
            let name = object.name;
            return Ok(Some(format!("object {name:?} has readings of it: delete it first")));
        }
    }
    let mut after = None;
    loop {
        let page = store.sessions().list_whole(after, PER_PAGE)?;
        // A session that ended before has none.
        let may_have =
            page.items.iter().filter(|it| it.closed_at_ms.is_none_or(|at| at >= created_at_ms));
        for session in may_have {
            if has_reading(&store.journal(), session.id, sensor)? {
                let id = session.id;
                return Ok(Some(format!("session {id} has readings of it: delete it first")));
            }
        }
        after = page.next;
        if after.is_none() {
            return Ok(None);
        }
    }
}

fn has_reading(journal: &Journal, session: Uuid, sensor: Uuid) -> Result<bool, Cause> {
    let mut next = 0;
    loop {
        let entries = journal.entries(session, next, PER_PAGE)?;
        if entries.is_empty() {
            return Ok(false);
        }
        if entries.iter().any(|entry| is_of(&entry.event, sensor)) {
            return Ok(true);
        }
        next += entries.len() as u64;
    }
}

fn is_of(event: &Event, sensor: Uuid) -> bool {
    matches!(event, Event::Reading(reading) if reading.sensor == sensor)
}
