//! Folding a session's journal into its belief, on a thread of the compute pool.

use std::sync::Arc;

use palpate_store::entity::{Session, StoredReading};
use palpate_store::journal::{Event, Journal};

use crate::belief::SessionBelief;
use crate::catalogues::Model;
use crate::refusal::Refusal;
use crate::sensors::Sensors;
use crate::wire::reading::from_store;
use crate::wire::session::{Options, base};

/// How many entries of a journal are read at once.
const ENTRIES_PER_READ: usize = 256;

/// Everything that folding needs, on a thread of the pool.
pub(crate) struct Folding {
    pub(super) session: Session,
    pub(super) model: Arc<Model>,
    pub(super) journal: Journal,
    pub(super) sensors: Arc<Sensors>,
    pub(super) options: Options,
    pub(super) from: u64,
    pub(super) length: u64,
}

impl Folding {
    pub(crate) fn run(&self, before: Option<SessionBelief>) -> Result<SessionBelief, Refusal> {
        let (mut belief, mut next) = match before {
            Some(belief) => (belief, self.from),
            None => (self.empty()?, 0),
        };
        while next < self.length {
            let limit = ENTRIES_PER_READ.min((self.length - next) as usize);
            let entries = self.journal.entries(self.session.id, next, limit)?;
            for entry in &entries {
                match &entry.event {
                    Event::Reading(reading) => {
                        let robot = entry.reading_id.as_ref().map(|id| id.robot.as_str());
                        self.fold(&mut belief, reading, robot)?;
                    }
                    Event::Retraction { .. } | Event::Closed => {}
                }
            }
            next += limit as u64;
        }
        Ok(belief)
    }

    fn empty(&self) -> Result<SessionBelief, Refusal> {
        SessionBelief::new(&self.session, &self.model).map_err(|error| self.unusable(&error))
    }

    fn fold(
        &self,
        belief: &mut SessionBelief,
        stored: &StoredReading,
        robot: Option<&str>,
    ) -> Result<(), Refusal> {
        let sensor = self.sensors.get(&stored.sensor.to_string())?;
        let calibration = self.sensors.calibrations().of(sensor.id, stored.calibration)?;
        let reading = from_store(stored, &sensor, calibration.as_deref())
            .map_err(|error| self.unusable(&error))?;
        let reading = match base(&self.options, robot) {
            Some(base) => reading.with_base(base),
            None => reading,
        };
        belief.add(stored, &reading, &sensor.description).map_err(|error| self.unusable(&error))
    }

    fn unusable(&self, error: &dyn std::error::Error) -> Refusal {
        let id = self.session.id.to_string();
        Refusal::Unusable { what: "session", id, reason: error.to_string() }
    }
}
