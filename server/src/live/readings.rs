//! The readings of a fold: those of the current request, or else those of the journal.
//!
//! A reading is parsed once, when it arrives. It is read back from the journal only for a belief
//! that is folded again: after a restart, or behind a late reading.

use std::collections::BTreeMap;
use std::sync::Arc;

use palpate_core::pose::Pose;
use palpate_core::reading::{Felt, Reading};
use palpate_store::entity::{ReadingId, Sensor, StoredReading};
use palpate_store::journal::{Entry, Event, Journal, NewEntry};
use uuid::Uuid;

use super::order::{Chronicle, Touch};
use crate::cause::Cause;
use crate::known_sensors::KnownSensors;
use crate::wire::felt::from_store;
use crate::wire::reading::Incoming;
use crate::wire::session::{Options, base};

/// Journal entries per read.
pub(super) const ENTRIES_PER_READ: usize = 256;

/// A reading prepared for folding.
#[derive(Clone)]
pub(super) struct Ready {
    pub(super) number: u32,
    pub(super) id: Option<ReadingId>,
    pub(super) stored: StoredReading,
    pub(super) reading: Felt,
    pub(super) sensor: Arc<Sensor>,
}

impl Ready {
    /// A reading of a request that becomes entry `number` of its session's journal.
    pub(super) fn of(number: u64, incoming: &Incoming, options: &Options) -> Self {
        let robot = incoming.id.as_ref().map(|id| id.robot.as_str());
        Self {
            number: number as u32,
            id: incoming.id.clone(),
            stored: incoming.stored.clone(),
            reading: on_its_base(incoming.reading.clone(), options, robot),
            sensor: Arc::clone(&incoming.sensor),
        }
    }

    /// The reading as an entry of a journal.
    pub(super) fn entry(&self, received_at_ms: u64, written_by: Option<Uuid>) -> NewEntry {
        let event = Event::Reading(self.stored.clone());
        NewEntry { reading_id: self.id.clone(), received_at_ms, event, written_by }
    }

    /// The sensor's pose after the correction, if one was sent.
    fn pose(&self) -> Option<Pose> {
        let press = self.reading.press().filter(|_| self.stored.session_from_sensor.is_some());
        press.map(Reading::session_from_sensor)
    }

    /// Whether the object may have moved before it.
    pub(super) fn object_moved(&self) -> bool {
        self.stored.object_moved.is_some()
    }
}

/// The readings of one session.
pub(crate) struct Readings {
    session: Uuid,
    journal: Journal,
    sensors: Arc<KnownSensors>,
    options: Options,
    /// The newest entries of the journal, by number, as just appended by a request.
    handed: BTreeMap<u32, Arc<Ready>>,
}

impl Readings {
    pub(super) fn new(
        session: Uuid,
        journal: Journal,
        sensors: Arc<KnownSensors>,
        options: Options,
        handed: Vec<Ready>,
    ) -> Self {
        let handed = handed.into_iter().map(|ready| (ready.number, Arc::new(ready))).collect();
        Self { session, journal, sensors, options, handed }
    }

    /// Brings a chronicle up to the journal's first `length` entries, or as many as there are.
    pub(super) fn tell(&self, chronicle: &mut Chronicle, length: usize) -> Result<(), Cause> {
        while chronicle.len() < length {
            let next = chronicle.len();
            if let Some(ready) = self.handed.get(&(next as u32)) {
                chronicle.take_reading(ready.id.as_ref(), &ready.stored, ready.pose());
                continue;
            }
            let first = self.handed.keys().next().map_or(length, |first| *first as usize);
            let last = if next < first { length.min(first) } else { length };
            let entries = self.entries(next, last)?;
            if entries.is_empty() {
                return Ok(());
            }
            for entry in &entries {
                chronicle.take(entry, self.pose(entry)?);
            }
        }
        Ok(())
    }

    /// The pose of an entry after its correction, if it is a reading that has one.
    pub(super) fn pose(&self, entry: &Entry) -> Result<Option<Pose>, Cause> {
        match &entry.event {
            Event::Reading(reading) => Ok(self.sensors.pose(reading)?),
            Event::Retraction { .. } | Event::Closed => Ok(None),
        }
    }

    /// Some of the journal's entries from `next` on, before `last`.
    pub(super) fn entries(&self, next: usize, last: usize) -> Result<Vec<Entry>, Cause> {
        let limit = ENTRIES_PER_READ.min(last.saturating_sub(next));
        Ok(self.journal.entries(self.session, next as u64, limit)?)
    }

    /// The readings of presses, prepared for folding. A motion announced by the first frame
    /// of a press applies to the frame that counts.
    pub(super) fn ready(&self, touches: &[Touch]) -> Result<Vec<Arc<Ready>>, Cause> {
        let numbers =
            touches.iter().flat_map(|touch| touch.moved_by.into_iter().chain([touch.number]));
        let mut ready = self.numbered(numbers.collect())?;
        let mut in_order = Vec::with_capacity(touches.len());
        for touch in touches {
            let first = touch.moved_by.map(|first| ready.remove(&first).ok_or_else(|| self.gone()));
            let mut counts = ready.remove(&touch.number).ok_or_else(|| self.gone())?;
            if let Some(first) = first.transpose()? {
                Arc::make_mut(&mut counts).stored.object_moved = first.stored.object_moved;
            }
            in_order.push(counts);
        }
        Ok(in_order)
    }

    /// Readings by their numbers: those of the request, and the others from the journal.
    fn numbered(&self, numbers: Vec<u32>) -> Result<BTreeMap<u32, Arc<Ready>>, Cause> {
        let mut ready = BTreeMap::new();
        let mut others = Vec::new();
        for number in numbers {
            match self.handed.get(&number) {
                Some(handed) => drop(ready.insert(number, Arc::clone(handed))),
                None => others.push(number),
            }
        }
        others.sort_unstable();
        for run in others.chunk_by(|a, b| a + 1 == *b) {
            for entry in self.journal.entries(self.session, u64::from(run[0]), run.len())? {
                if let Some(one) = self.one(entry)? {
                    ready.insert(one.number, Arc::new(one));
                }
            }
        }
        Ok(ready)
    }

    fn one(&self, entry: Entry) -> Result<Option<Ready>, Cause> {
        let Event::Reading(stored) = entry.event else { return Ok(None) };
        let robot = entry.reading_id.as_ref().map(|id| id.robot.as_str());
        let sensor = self.sensors.get(&stored.sensor.to_string())?;
        let applied = self.sensors.applied(sensor.id, stored.calibration)?;
        let correction = applied.as_ref().map(|applied| &*applied.correction);
        let reading = from_store(&stored, &sensor, correction).map_err(|error| {
            let id = self.session.to_string();
            Cause::Unusable { what: "session", id, reason: error.to_string() }
        })?;
        let reading = on_its_base(reading, &self.options, robot);
        let sensor = applied.map_or(sensor, |applied| applied.sensor);
        let (number, id) = (entry.seq as u32, entry.reading_id);
        Ok(Some(Ready { number, id, stored, reading, sensor }))
    }

    /// The error of a missing reading: the session was deleted.
    pub(super) fn gone(&self) -> Cause {
        Cause::unknown("session", self.session)
    }
}

/// A reading with the base of its robot, where that is not exact.
fn on_its_base(reading: Felt, options: &Options, robot: Option<&str>) -> Felt {
    match base(options, robot) {
        Some(base) => reading.with_base(base),
        None => reading,
    }
}

#[cfg(test)]
mod tests {
    use std::ops::Range;

    use palpate_core::sensor::{SensorDescription, SensorKnowledge, StatedRanges};
    use palpate_store::database::Database;

    use super::*;
    use crate::wire::reading::{Source, one};

    const SESSION: Uuid = Uuid::from_u128(1);

    /// A database whose sensor is known, and readings of it as a request brings them.
    async fn arrived(n: u64) -> (Database, Arc<KnownSensors>, Vec<Ready>) {
        let store = Database::in_memory();
        let description = SensorDescription::preset_named("digitacts-6x6").unwrap();
        let image = vec![Some(3.0e3); description.grid().n_taxels()];
        let id = Uuid::from_u128(2);
        let (name, preset) = ("finger".to_owned(), None);
        let (knowledge, ranges) = (SensorKnowledge::DataSheet, StatedRanges::default());
        let (labels, used, created_at_ms) = (palpate_store::entity::Labels::new(), false, 0);
        let sensor = Sensor {
            id,
            name,
            preset,
            description,
            knowledge,
            ranges,
            labels,
            used,
            created_at_ms,
        };
        store.sensors().create(&sensor).await.unwrap();
        let sensors = Arc::new(KnownSensors::new(store.clone()));
        let source = sensors.source(Arc::new(sensor)).unwrap();
        let ready = |seq: u64| {
            let body = serde_json::json!({
                "sensor": "finger", "robot": "arm", "seq": seq, "image": image,
                "pose": { "position": [0.1 * seq as f64, 0.2, 0.3],
                    "orientation": [0.5, 0.5, -0.5, 0.5] },
            });
            let given = serde_json::from_value(body).unwrap();
            let Source { sensor, applied } = source.clone();
            let incoming = one("", &given, Some(Source { sensor, applied }), None).unwrap();
            Ready::of(seq, &incoming, &Options::default())
        };
        let ready: Vec<Ready> = (0..n).map(ready).collect();
        (store, sensors, ready)
    }

    fn touches(numbers: Range<u32>) -> Vec<Touch> {
        numbers.map(|number| Touch { number, moved_by: None }).collect()
    }

    /// Nothing is in the journal, so every reading that comes was handed on.
    #[tokio::test]
    async fn readings_that_were_handed_on_are_not_read_again() {
        let (store, sensors, ready) = arrived(3).await;
        let options = Options::default();
        let readings = Readings::new(SESSION, store.journal(), sensors, options, ready);
        let mut chronicle = Chronicle::default();
        readings.tell(&mut chronicle, 3).unwrap();
        assert_eq!(chronicle.len(), 3);
        let found = readings.ready(&touches(0..3)).unwrap();
        assert_eq!(found.iter().map(|ready| ready.number).collect::<Vec<_>>(), [0, 1, 2]);
    }

    #[tokio::test]
    async fn readings_are_the_same_from_the_journal_and_from_the_request() {
        let (store, sensors, ready) = arrived(3).await;
        let entries: Vec<NewEntry> = ready.iter().map(|ready| ready.entry(5, None)).collect();
        store.journal().append(SESSION, 0, &entries).await.unwrap();
        let newest = vec![ready[2].clone()];
        let options = Options::default();
        let readings = Readings::new(SESSION, store.journal(), sensors, options, newest);
        let mut chronicle = Chronicle::default();
        readings.tell(&mut chronicle, 3).unwrap();
        assert_eq!(chronicle.len(), 3, "two are read, the newest was handed on");
        for (found, expected) in readings.ready(&touches(0..3)).unwrap().iter().zip(&ready) {
            assert_eq!((&found.stored, &found.id), (&expected.stored, &expected.id));
            assert_eq!(found.reading, expected.reading, "bit for bit");
        }
    }
}
