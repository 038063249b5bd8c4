//! Days of sensors: what the sessions that ended on one day say about a sensor, a record a day.
//!
//! A session is counted in the commit that notes its id, so it counts once however often it is
//! added. Each sensor keeps at most [`DAYS_MAX`] days: its newest, and the first under the newest
//! calibration, with which the newest are compared.

mod stored;

use std::sync::Arc;

use palpate_core::health::day::Day;
use uuid::Uuid;

use crate::engine::{Commit, Engine, Expected, Pair};
use crate::error::{StoreError, conflict};
use crate::key::{self, Space};
use crate::pieces::{self, Limit};
use crate::record;

/// Maximum number of days of a sensor.
pub const DAYS_MAX: usize = 30;
/// Maximum number of sessions that count on one day of a sensor. Chosen: their ids take 16 KiB,
/// and more would not change the sums' verdict.
pub const SESSIONS_MAX: usize = 1024;
/// Length of a day's key: space, sensor, day.
const KEY_BYTES: usize = 25;
/// Attempts of an addition under concurrent additions.
const ADD_ATTEMPTS: usize = 64;

/// A stored day of a sensor.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SensorDay {
    /// The sensor.
    pub sensor: Uuid,
    /// The sessions that are counted, ascending.
    pub sessions: Vec<Uuid>,
    /// Their sums.
    pub day: Day,
}

impl SensorDay {
    /// Whether a session may still be counted.
    #[must_use]
    pub fn takes(&self, session: Uuid) -> bool {
        self.sessions.len() < SESSIONS_MAX && self.sessions.binary_search(&session).is_err()
    }
}

/// The days of all sensors.
#[derive(Clone)]
pub struct SensorDays {
    engine: Arc<dyn Engine>,
}

impl SensorDays {
    pub(crate) fn new(engine: Arc<dyn Engine>) -> Self {
        Self { engine }
    }

    /// Adds a session's sums to a sensor's day of the same number; durable when it returns.
    /// Returns `false`, and changes nothing, if the session is counted already, the day is full
    /// or older than the ring, or the sensor does not exist.
    ///
    /// # Errors
    /// [`StoreError::Changed`] only under endless concurrent additions; [`StoreError::Damaged`]
    /// and the engine's.
    pub async fn add(&self, sensor: Uuid, session: Uuid, sums: &Day) -> Result<bool, StoreError> {
        let owner = key::id(Space::Sensor, sensor);
        let head = key::numbered(Space::SensorDay, sensor, u64::from(sums.day));
        for _ in 0..ADD_ATTEMPTS {
            // A removed sensor gets no more days.
            let Some(owned) = self.engine.get(&owner)? else { return Ok(false) };
            let before = pieces::read(&*self.engine, Space::SensorDay, &head)?;
            let mut commit = Commit::new().expect(owner.clone(), Expected::Value(owned));
            let mut today = match &before {
                Some(bytes) => {
                    commit = commit.expect(head.clone(), Expected::Value(pieces::first(bytes)));
                    decoded(bytes)?
                }
                None => {
                    commit = commit.expect(head.clone(), Expected::Absent);
                    let Some(with_room) = self.with_room(commit, sensor, sums)? else {
                        return Ok(false);
                    };
                    commit = with_room;
                    let day =
                        Day { day: sums.day, calibration: sums.calibration, ..Day::default() };
                    SensorDay { sensor, sessions: Vec::new(), day }
                }
            };
            if !today.takes(session) {
                return Ok(false);
            }
            let place = today.sessions.partition_point(|counted| *counted < session);
            today.sessions.insert(place, session);
            today.day.merge(sums);
            let commit = pieces::put(commit, &head, &record::encode(&today), before.as_deref());
            match self.engine.commit(commit).await.map_err(conflict) {
                Ok(()) => return Ok(true),
                Err(Ok(_)) => {}
                Err(Err(error)) => return Err(error.into()),
            }
        }
        Err(StoreError::Changed { what: "days of sensor", id: sensor })
    }

    /// A day of a sensor.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] and the engine's.
    pub fn find(&self, sensor: Uuid, day: u32) -> Result<Option<SensorDay>, StoreError> {
        let head = key::numbered(Space::SensorDay, sensor, u64::from(day));
        let found = pieces::read(&*self.engine, Space::SensorDay, &head)?;
        found.map(|bytes| decoded(&bytes)).transpose()
    }

    /// All days of a sensor, oldest first.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] and the engine's.
    pub fn all(&self, sensor: Uuid) -> Result<Vec<SensorDay>, StoreError> {
        self.records(sensor)?.iter().map(|(_, bytes)| decoded(bytes)).collect()
    }

    fn records(&self, sensor: Uuid) -> Result<Vec<Pair>, StoreError> {
        let prefix = key::id(Space::SensorDay, sensor);
        let limit = Limit::records(usize::MAX);
        pieces::scan(&*self.engine, Space::SensorDay, &prefix, KEY_BYTES, None, limit)
    }

    /// A commit that also removes the days for which a new one leaves no room; `None` if the new
    /// one would be the first to go.
    fn with_room(
        &self,
        mut commit: Commit,
        sensor: Uuid,
        new: &Day,
    ) -> Result<Option<Commit>, StoreError> {
        let records = self.records(sensor)?;
        let n_surplus = (records.len() + 1).saturating_sub(DAYS_MAX);
        if n_surplus == 0 {
            return Ok(Some(commit));
        }
        let days: Result<Vec<SensorDay>, StoreError> =
            records.iter().map(|(_, bytes)| decoded(bytes)).collect();
        let days = days?;
        let newest = days.last().map_or(new.calibration, |last| {
            if last.day.day < new.day { new.calibration } else { last.day.calibration }
        });
        let first = days.iter().position(|it| it.day.calibration == newest);
        let oldest = (0..days.len()).filter(|place| Some(*place) != first).take(n_surplus);
        for place in oldest {
            if days[place].day.day > new.day {
                return Ok(None);
            }
            let (head, bytes) = &records[place];
            commit = commit.expect(head.clone(), Expected::Value(pieces::first(bytes)));
            commit = pieces::remove(commit, head, bytes);
        }
        Ok(Some(commit))
    }
}

fn decoded(bytes: &[u8]) -> Result<SensorDay, StoreError> {
    record::decode(bytes).map_err(StoreError::damaged(Space::SensorDay))
}
