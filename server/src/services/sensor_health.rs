//! The health of sensors: ended sessions that wait to be counted, the sums of their presses, and
//! the states of all sensors.
//!
//! A session is counted after its end, on the day of its end. Days are stored with the sessions
//! that they count, so counting one again changes nothing, and what a stop leaves over is found
//! again at the next start. Not here: the belief of a session (`sessions`).

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use dashmap::DashMap;
use palpate_core::contact::touches;
use palpate_core::health::day::Day;
use palpate_core::reading::Felt;
use palpate_schemas as wire;
use palpate_schemas::HealthState;
use palpate_store::database::Database;
use palpate_store::entity::{Sensor, StoredReading};
use palpate_store::error::StoreError;
use palpate_store::journal::{Entry, Event};
use tokio::sync::Notify;
use uuid::Uuid;

use crate::cause::Cause;
use crate::known_sensors::{KnownSensors, UnknownSensor};
use crate::wire::felt::from_store;
use crate::wire::sensor_health::{DAY_MS, health, state_of};

/// Maximum number of sessions that wait. Chosen: what robots end in a minute; later ones are
/// found at the next start.
const WAITING_MAX: usize = 10_000;
/// Number of journal entries per read.
const ENTRIES_PER_READ: usize = 256;

/// Health of all sensors.
pub(crate) struct SensorHealth {
    store: Database,
    known: Arc<KnownSensors>,
    waiting: Mutex<Waiting>,
    ended: Notify,
    states: DashMap<Uuid, HealthState>,
}

/// Sessions to count.
#[derive(Default)]
struct Waiting {
    sessions: VecDeque<Uuid>,
    /// The one that is being counted.
    current: Option<Uuid>,
}

/// What the readings of a session say.
#[derive(Debug, Default)]
pub(crate) struct Counted {
    /// Sums by sensor.
    pub(crate) days: BTreeMap<Uuid, Day>,
    /// The sensors of presses with contact; nil for contacts without an image.
    pub(crate) touched_by: BTreeSet<Uuid>,
}

impl SensorHealth {
    pub(crate) fn new(store: Database, known: Arc<KnownSensors>) -> Self {
        let (waiting, ended, states) = (Mutex::default(), Notify::new(), DashMap::new());
        Self { store, known, waiting, ended, states }
    }

    fn waiting(&self) -> MutexGuard<'_, Waiting> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Notes a session that has ended.
    pub(crate) fn note(&self, session: Uuid) {
        let mut waiting = self.waiting();
        if waiting.sessions.len() >= WAITING_MAX {
            metrics::counter!("palpate_sensor_health_left_out_total").increment(1);
            return;
        }
        waiting.sessions.push_back(session);
        self.ended.notify_one();
    }

    /// The next session to count; the one before is done.
    pub(crate) async fn next(&self) -> Uuid {
        loop {
            let next = {
                let mut waiting = self.waiting();
                waiting.current = waiting.sessions.pop_front();
                waiting.current
            };
            match next {
                Some(session) => return session,
                None => self.ended.notified().await,
            }
        }
    }

    /// Number of sessions that are not counted yet.
    fn n_waiting(&self) -> usize {
        let waiting = self.waiting();
        waiting.sessions.len() + usize::from(waiting.current.is_some())
    }

    /// The sums of a session's readings, on the day of its end. Blocks.
    pub(crate) fn counted(&self, session: Uuid, ended_at_ms: u64) -> Result<Counted, Cause> {
        let journal = self.store.journal();
        let has_retractions = journal.head(session)?.n_retracted > 0;
        let (mut counted, mut next) = (Counted::default(), 0);
        let day = u32::try_from(ended_at_ms / DAY_MS).unwrap_or(u32::MAX);
        loop {
            let entries = journal.entries(session, next, ENTRIES_PER_READ)?;
            if entries.is_empty() {
                return Ok(counted);
            }
            next += entries.len() as u64;
            for Entry { seq, event, .. } in entries {
                let Event::Reading(reading) = event else { continue };
                if !(has_retractions && journal.retraction(session, seq)?.is_some()) {
                    self.count(&mut counted, &reading, day)?;
                }
            }
        }
    }

    fn count(&self, counted: &mut Counted, stored: &StoredReading, day: u32) -> Result<(), Cause> {
        let sensor = match self.known.get(&stored.sensor.to_string()) {
            Ok(sensor) => sensor,
            Err(UnknownSensor::Store(error)) => return Err(error.into()),
            // It was removed.
            Err(_) => return Ok(()),
        };
        let calibration = self.known.calibration(sensor.id, stored.calibration)?;
        let Ok(felt) = from_store(stored, &sensor, calibration.as_deref()) else { return Ok(()) };
        let Felt::Press(reading) = felt else {
            counted.touched_by.insert(Uuid::nil());
            return Ok(());
        };
        if touches(&reading, &sensor.description) {
            counted.touched_by.insert(sensor.id);
        }
        let sums = counted.days.entry(sensor.id).or_default();
        if sums.calibration < stored.calibration {
            *sums = Day::default();
        }
        sums.day = day;
        if sums.calibration <= stored.calibration {
            sums.calibration = stored.calibration;
            sums.presses.add(&reading, &sensor.description);
        }
        Ok(())
    }

    /// Whether a session is counted on a sensor's day already.
    pub(crate) fn has(&self, sensor: Uuid, session: Uuid, day: &Day) -> Result<bool, StoreError> {
        self.store.sensor_days().has(sensor, session, day.day)
    }

    /// Stores the sums of a session, and judges the sensor again.
    pub(crate) async fn add(&self, sensor: Uuid, session: Uuid, sums: &Day) -> Result<(), Cause> {
        if self.store.sensor_days().add(sensor, session, sums).await? {
            metrics::counter!("palpate_sensor_health_sessions_total").increment(1);
        }
        Ok(())
    }

    /// Judges a sensor by its days. Blocks.
    pub(crate) fn judge(&self, sensor: Uuid) -> Result<(), Cause> {
        let Some(sensor) = self.known.find(&sensor.to_string())? else { return Ok(()) };
        let days = self.store.sensor_days().all(sensor.id)?;
        if days.is_empty() {
            return Ok(());
        }
        let state = state_of(&sensor, &days);
        let before = self.states.insert(sensor.id, state);
        if state == HealthState::Commission && before != Some(state) {
            let (id, name) = (sensor.id, &sensor.name);
            let summary = health(&sensor, &days, 0).summary;
            tracing::warn!(sensor.id = %id, "Sensor {name:?}: {summary}");
        }
        Ok(())
    }

    /// Judges all sensors, at the start. Blocks.
    pub(crate) fn judge_all(&self) -> Result<(), Cause> {
        for sensor in self.store.sensors().list_whole(None, usize::MAX - 1)?.items {
            self.judge(sensor.id)?;
        }
        Ok(())
    }

    /// Drops the state of a removed sensor.
    pub(crate) fn forget(&self, sensor: Uuid) {
        self.states.remove(&sensor);
    }

    /// The health of a sensor in its wire form. Blocks.
    pub(crate) fn show(&self, sensor: &Sensor) -> Result<wire::SensorHealth, Cause> {
        // Counted before they are read: what no longer waits is in the answer.
        let n_waiting = self.n_waiting();
        Ok(health(sensor, &self.store.sensor_days().all(sensor.id)?, n_waiting))
    }

    /// Updates the numbers of sensors by state.
    pub(crate) fn measure(&self) {
        let states = [
            ("unknown", HealthState::Unknown),
            ("good", HealthState::Good),
            ("watch", HealthState::Watch),
            ("commission", HealthState::Commission),
        ];
        for (name, state) in states {
            let n = self.states.iter().filter(|entry| *entry.value() == state).count();
            metrics::gauge!("palpate_sensors", "health" => name).set(n as f64);
        }
        for name in ["palpate_sensor_health_sessions_total", "palpate_sensor_health_left_out_total"]
        {
            metrics::counter!(name).increment(0);
        }
    }
}
