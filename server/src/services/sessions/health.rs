//! Counting of ended sessions towards the health of their sensors, in the background, which also
//! keeps their outcomes.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use palpate_core::belief::answer::{Answer, SensorShift};
use palpate_schemas::Method;
use palpate_store::entity::Session;
use tokio::sync::watch;
use uuid::Uuid;

use super::{SessionError, Sessions, is_idle};
use crate::clock::pause;
use crate::compute::{ComputeError, Place};
use crate::wire::session::options;

/// Probability from which a session's object counts as recognised. Chosen: an error of one in a
/// hundred does not outvote the other sessions.
const SURE: f64 = 0.99;
/// The same when a client has confirmed the object.
const CONFIRMED: f64 = 0.5;
/// Number of touches from which a session's shift counts: as for its warning.
const TOUCHES_MIN: usize = 6;
/// Number of readings up to which an ended session's belief is folded again. Chosen: sessions
/// that need more are rare, and recognised before.
pub(super) const READINGS_MAX: u64 = 64;
/// Number of shifts of a day from which beliefs are no longer folded again for more. Chosen: the
/// mean of as many is as good as it gets, and folding costs what the session's touches did.
const SHIFTS_ENOUGH: u32 = 20;
/// Pause after a session that could not be counted.
const AFTER_ERROR: Duration = Duration::from_secs(1);
/// Time before a start in which ended sessions may not have been counted. Chosen: longer than a
/// server is down.
pub(super) const LOOK_BACK_MS: u64 = 2 * 86_400_000;

impl Sessions {
    /// Counts ended sessions until the server stops.
    pub(crate) async fn keep_health(self: Arc<Self>, mut stopping: watch::Receiver<bool>) {
        let health = self.sensors.health();
        let sessions = Arc::clone(&self);
        let judged = tokio::task::spawn_blocking(move || sessions.sensors.health().judge_all());
        if let Ok(Err(error)) = judged.await {
            tracing::error!("Cannot judge the health of sensors: {error}");
        }
        loop {
            let next = tokio::select! {
                biased;
                _ = stopping.wait_for(|stopping| *stopping) => return,
                session = health.next() => session,
            };
            if let Err(error) = self.count_health(next).await {
                tracing::error!(session.id = %next,
                    "Cannot count session {next} towards the health of its sensors: {error}");
                if !pause(AFTER_ERROR, &mut stopping).await {
                    return;
                }
            }
        }
    }

    async fn count_health(self: &Arc<Self>, id: Uuid) -> Result<(), SessionError> {
        let Some(session) = self.tools.store.sessions().find(id)? else { return Ok(()) };
        let status = self.status(&session)?;
        let Some(end) = status.end else { return Ok(()) };
        self.keep_outcome(&session, &status).await?;
        let place = self.place().await?;
        let sessions = Arc::clone(self);
        let counting = move || sessions.sensors.health().counted(id, end.at_ms);
        let mut counted = place.run_long(counting).await??;
        let health = self.sensors.health();
        // The sensors that lack the session, and the number of shifts they have.
        let mut lacking = BTreeMap::new();
        for (sensor, day) in &counted.days {
            let stored = health.day(*sensor, day.day)?;
            if stored.takes(id) {
                lacking.insert(*sensor, stored.day.shifts.n_sessions);
            }
        }
        // A shift is that of one sensor.
        let mut touched_by = counted.touched_by.iter();
        if let (Some(sensor), None) = (touched_by.next(), touched_by.next())
            && let Some(n_shifts) = lacking.get(sensor)
            && let Some(shift) = self.shift_of(&session, status.length, *n_shifts).await?
            && let Some(day) = counted.days.get_mut(sensor)
        {
            day.shifts.add(&shift);
        }
        for sensor in lacking.into_keys() {
            health.add(sensor, id, &counted.days[&sensor]).await?;
            let sessions = Arc::clone(self);
            let place = self.place().await?;
            place.run_long(move || sessions.sensors.health().judge(sensor)).await??;
        }
        Ok(())
    }

    /// Waits until the compute pool has a slot; no client waits for the result.
    pub(super) async fn place(&self) -> Result<Place, ComputeError> {
        self.tools.pool.place_in_time().await.map_err(|_| ComputeError::Stopped)
    }

    /// The shift that the touches of an ended session share, if it recognised its object.
    /// `n_shifts` are known of the day.
    async fn shift_of(
        &self,
        session: &Session,
        length: u64,
        n_shifts: u32,
    ) -> Result<Option<SensorShift>, SessionError> {
        let options = options(session);
        let was_live = self.live.contains_key(&session.id);
        let is_folded = was_live && u64::from(self.tools.traces.revision(session.id)) == length;
        let is_costly = !is_folded && (length > READINGS_MAX || n_shifts >= SHIFTS_ENOUGH);
        if options.method != Method::Surface || is_costly {
            return Ok(None);
        }
        let live = self.live(session.id).await?;
        let place = self.place().await?;
        let answer = live.concluded(place).await?.answer;
        let truth = options.truth.map(|truth| {
            truth.object.and_then(|id| live.model().objects.iter().position(|it| it.id == id))
        });
        drop(live);
        if !was_live {
            self.live.remove_if(&session.id, |_, live| is_idle(live));
        }
        Ok(shift(&answer, truth))
    }
}

/// The shift of a belief that is sure of its object. `truth` is the object that a client has
/// confirmed, inside for one of the catalogue.
fn shift(answer: &Answer, truth: Option<Option<usize>>) -> Option<SensorShift> {
    let best = answer.best_object()?.0 as usize;
    let least = match truth {
        Some(object) if object == Some(best) => CONFIRMED,
        Some(_) => return None,
        None => SURE,
    };
    let is_sure = answer.probabilities[best] >= least;
    answer.sensor_shift.filter(|shift| is_sure && shift.n_touches >= TOUCHES_MIN)
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    fn answer(probability: f64, n_touches: usize) -> Answer {
        let (shift, deviation) = (DVec3::Z * 1e-3, DVec3::splat(1e-4));
        Answer {
            probabilities: vec![(1.0 - probability) / 2.0, probability],
            unknown: (1.0 - probability) / 2.0,
            modes: Vec::new(),
            entropy_bits: 0.0,
            n_readings: n_touches,
            sensor_shift: Some(SensorShift { shift, deviation, n_touches }),
            image_doubt: None,
        }
    }

    #[test]
    fn a_shift_counts_if_the_object_is_sure_or_confirmed() {
        let counts = |probability, n, truth| shift(&answer(probability, n), truth).is_some();
        assert!(counts(0.995, 6, None));
        assert!(!counts(0.98, 6, None), "not sure");
        assert!(!counts(0.995, 5, None), "few touches");
        assert!(counts(0.6, 6, Some(Some(1))), "confirmed");
        assert!(!counts(0.4, 6, Some(Some(1))));
        assert!(!counts(0.995, 6, Some(Some(0))), "it was another object");
        assert!(!counts(0.995, 6, Some(None)), "it was none of these");
    }
}
