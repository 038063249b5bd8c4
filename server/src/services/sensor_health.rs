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
use palpate_core::health::presses::PressRun;
use palpate_core::health::shifts::ShiftSums;
use palpate_core::reading::Felt;
use palpate_schemas as wire;
use palpate_schemas::HealthState;
use palpate_store::database::Database;
use palpate_store::entity::{Sensor, StoredReading};
use palpate_store::error::StoreError;
use palpate_store::journal::{Entry, Event};
use palpate_store::sensor_day::SensorDay;
use tokio::sync::Notify;
use uuid::Uuid;

use crate::cause::Cause;
use crate::known_sensors::{KnownSensors, UnknownSensor};
use crate::wire::felt::from_store;
use crate::wire::sensor_health::{DAY_MS, health, warning};

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
    /// The newest verdicts, without their images.
    verdicts: DashMap<Uuid, wire::SensorHealth>,
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
    /// Sums by sensor, once all readings are counted.
    pub(crate) days: BTreeMap<Uuid, Day>,
    /// The sensors of presses with contact; nil for contacts without an image.
    pub(crate) touched_by: BTreeSet<Uuid>,
    /// Presses by sensor, of the newest calibration among them.
    presses: BTreeMap<Uuid, (u32, PressRun)>,
}

impl SensorHealth {
    pub(crate) fn new(store: Database, known: Arc<KnownSensors>) -> Self {
        let (waiting, ended, verdicts) = (Mutex::default(), Notify::new(), DashMap::new());
        Self { store, known, waiting, ended, verdicts }
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
                break;
            }
            next += entries.len() as u64;
            for Entry { seq, event, .. } in entries {
                let Event::Reading(reading) = event else { continue };
                if !(has_retractions && journal.retraction(session, seq)?.is_some()) {
                    self.count(&mut counted, &reading)?;
                }
            }
        }
        for (sensor, (calibration, presses)) in std::mem::take(&mut counted.presses) {
            let (presses, shifts) = (presses.sums().clone(), ShiftSums::default());
            counted.days.insert(sensor, Day { day, calibration, presses, shifts });
        }
        Ok(counted)
    }

    fn count(&self, counted: &mut Counted, stored: &StoredReading) -> Result<(), Cause> {
        let sensor = match self.known.get(&stored.sensor.to_string()) {
            Ok(sensor) => sensor,
            Err(UnknownSensor::Store(error)) => return Err(error.into()),
            // It was removed.
            Err(_) => return Ok(()),
        };
        let correction = self.known.correction(stored)?;
        let Ok(felt) = from_store(stored, &sensor, correction.as_deref()) else { return Ok(()) };
        let Felt::Press(reading) = felt else {
            counted.touched_by.insert(Uuid::nil());
            return Ok(());
        };
        if touches(&reading, &sensor.description) {
            counted.touched_by.insert(sensor.id);
        }
        let (calibration, presses) = counted.presses.entry(sensor.id).or_default();
        if *calibration < stored.calibration {
            (*calibration, *presses) = (stored.calibration, PressRun::default());
        }
        if *calibration == stored.calibration {
            presses.add(&reading, &sensor.description);
        }
        Ok(())
    }

    /// A day of a sensor as it is stored; empty before its first session.
    pub(crate) fn day(&self, sensor: Uuid, day: u32) -> Result<SensorDay, StoreError> {
        Ok(self.store.sensor_days().find(sensor, day)?.unwrap_or_default())
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
        let verdict = health(&sensor, self.calibration(sensor.id)?, &days, 0);
        let verdict = wire::SensorHealth { rest: None, ..verdict };
        let (state, summary) = (verdict.state, verdict.summary.clone());
        let before = self.verdicts.insert(sensor.id, verdict);
        if state == HealthState::Commission && before.is_none_or(|it| it.state != state) {
            tracing::warn!(sensor.id = %sensor.id, "Sensor {:?}: {summary}", sensor.name);
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

    /// Drops the verdict of a removed sensor.
    pub(crate) fn forget(&self, sensor: Uuid) {
        self.verdicts.remove(&sensor);
    }

    /// The health of a sensor in its wire form. Blocks.
    pub(crate) fn show(&self, sensor: &Sensor) -> Result<wire::SensorHealth, Cause> {
        // Read before the days are: a session that no longer waits is in the answer.
        let n_waiting = self.n_waiting();
        let (number, days) =
            (self.calibration(sensor.id)?, self.store.sensor_days().all(sensor.id)?);
        Ok(health(sensor, number, &days, n_waiting))
    }

    /// The number of a sensor's newest calibration.
    fn calibration(&self, sensor: Uuid) -> Result<Option<u32>, UnknownSensor> {
        Ok(self.known.newest(sensor)?.map(|applied| applied.number))
    }

    /// The state of a verdict; unknown once the sensor has another calibration.
    fn state(&self, verdict: &wire::SensorHealth) -> HealthState {
        let is_current = self.calibration(verdict.sensor).is_ok_and(|it| it == verdict.calibration);
        if is_current { verdict.state } else { HealthState::Unknown }
    }

    /// Warnings about readings of these sensors: one a sensor that is to be commissioned again, at
    /// its first reading.
    pub(crate) fn warnings(&self, sensors: &[Uuid]) -> Vec<wire::Warning> {
        let first = |index: &usize| !sensors[..*index].contains(&sensors[*index]);
        let warned = |index: usize| {
            let verdict = self.verdicts.get(&sensors[index])?;
            (self.state(&verdict) == HealthState::Commission).then(|| warning(index, &verdict))
        };
        (0..sensors.len()).filter(first).filter_map(warned).collect()
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
            let n = self.verdicts.iter().filter(|verdict| self.state(verdict) == state).count();
            metrics::gauge!("palpate_sensors", "health" => name).set(n as f64);
        }
        for name in ["palpate_sensor_health_sessions_total", "palpate_sensor_health_left_out_total"]
        {
            metrics::counter!(name).increment(0);
        }
    }
}
