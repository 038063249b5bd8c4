//! The readings of an ended session, for a replay by another calibration.

use std::sync::Arc;

use palpate_core::reading::Felt;
use palpate_core::sensor::SensorDescription;
use palpate_store::database::Database;
use palpate_store::entity::Session;

use super::order::Chronicle;
use super::readings::{Readings, Ready};
use crate::cause::Cause;
use crate::known_sensors::KnownSensors;
use crate::wire::session::options;

/// The first readings of a session that count, in folding order.
pub(crate) struct PastReadings(Vec<Arc<Ready>>);

impl PastReadings {
    /// Reads the first `n_max` readings of a session. Those from an announced move on are left out:
    /// the belief of before it would be a part of what is judged.
    pub(crate) fn read(
        store: &Database,
        sensors: &Arc<KnownSensors>,
        session: &Session,
        n_max: usize,
    ) -> Result<Self, Cause> {
        let journal = store.journal();
        let length = journal.len(session.id)? as usize;
        let (sensors, options) = (Arc::clone(sensors), options(session));
        let readings = Readings::new(session.id, journal, sensors, options, Vec::new());
        let mut chronicle = Chronicle::default();
        readings.tell(&mut chronicle, length)?;
        chronicle.settle();
        let order = chronicle.order();
        let mut ready = readings.ready(&order[..order.len().min(n_max)])?;
        let moved = ready.iter().skip(1).position(|ready| ready.object_moved());
        ready.truncate(moved.map_or(usize::MAX, |at| at + 1));
        Ok(Self(ready))
    }

    /// The readings with their sensors.
    pub(crate) fn felt(&self) -> Vec<(&Felt, &SensorDescription)> {
        self.0.iter().map(|ready| (&ready.reading, &ready.sensor.description)).collect()
    }
}
