//! The newest beliefs of the open sessions in short, from which the server judges which sessions
//! need attention.
//!
//! A restart forgets them; they are then formed again from the journals.

use std::collections::VecDeque;

use dashmap::DashMap;
use palpate_schemas as wire;
use uuid::Uuid;

use crate::wire::time;

/// Number of beliefs kept of a session. Chosen: three times the readings after which a session
/// without progress is stuck, and enough for a small plot.
pub(crate) const TRACE_MAX: usize = 24;

/// A belief of a session in short.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Point {
    pub(crate) revision: u32,
    pub(crate) n_readings: u32,
    /// When the newest change of the revision arrived (ms since 1970).
    pub(crate) at_ms: u64,
    pub(crate) best: Option<wire::BestObject>,
    pub(crate) unknown: f64,
    pub(crate) entropy_bits: f64,
    /// What a warning of the belief says: all touches of the session are off alike.
    pub(crate) warning: Option<String>,
}

impl Point {
    pub(crate) fn of(belief: &wire::Belief, at_ms: u64) -> Self {
        let best = belief.objects.first().map(|object| wire::BestObject {
            object: object.object,
            name: object.name.clone(),
            probability: object.probability,
        });
        Self {
            revision: belief.revision,
            n_readings: belief.n_readings,
            at_ms,
            best,
            unknown: belief.unknown,
            entropy_bits: belief.entropy_bits,
            warning: belief.warnings.first().map(|warning| warning.detail.clone()),
        }
    }

    pub(crate) fn shown(&self) -> wire::TracePoint {
        wire::TracePoint {
            revision: self.revision,
            n_readings: self.n_readings,
            at: time(self.at_ms),
            best: self.best.clone(),
            unknown: self.unknown,
            entropy_bits: self.entropy_bits,
        }
    }
}

/// The newest beliefs of the open sessions, oldest first.
#[derive(Default)]
pub(crate) struct Traces(DashMap<Uuid, VecDeque<Point>>);

impl Traces {
    /// Adds beliefs of a session; those of known revisions replace them.
    pub(crate) fn note(&self, session: Uuid, points: impl IntoIterator<Item = Point>) {
        let mut trace = self.0.entry(session).or_default();
        for point in points {
            match trace.binary_search_by_key(&point.revision, |known| known.revision) {
                Ok(at) => trace[at] = point,
                Err(at) => trace.insert(at, point),
            }
        }
        let surplus = trace.len().saturating_sub(TRACE_MAX);
        trace.drain(..surplus);
    }

    /// The newest beliefs of a session.
    pub(crate) fn of(&self, session: Uuid) -> Vec<Point> {
        self.0.get(&session).map(|trace| trace.iter().cloned().collect()).unwrap_or_default()
    }

    /// The newest belief in a session's trace.
    pub(crate) fn newest(&self, session: Uuid) -> Option<Point> {
        self.0.get(&session).and_then(|trace| trace.back().cloned())
    }

    /// The newest revision in a session's trace; 0 without one.
    pub(crate) fn revision(&self, session: Uuid) -> u32 {
        self.0.get(&session).and_then(|trace| trace.back().map(|it| it.revision)).unwrap_or(0)
    }

    /// Forgets all sessions but these.
    pub(crate) fn retain(&self, is_open: impl Fn(Uuid) -> bool) {
        self.0.retain(|session, _| is_open(*session));
    }

    pub(crate) fn forget(&self, session: Uuid) {
        self.0.remove(&session);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(revision: u32, unknown: f64) -> Point {
        let (n_readings, at_ms) = (revision, u64::from(revision));
        let (best, entropy_bits, warning) = (None, 0.0, None);
        Point { revision, n_readings, at_ms, best, unknown, entropy_bits, warning }
    }

    #[test]
    fn a_trace_keeps_the_newest_revisions_in_order() {
        let (traces, id) = (Traces::default(), Uuid::from_u128(1));
        traces.note(id, (20..=40).map(|n| point(n, 0.0)));
        traces.note(id, [point(40, 0.5)]);
        traces.note(id, (1..=19).map(|n| point(n, 0.0)));
        let trace = traces.of(id);
        let revisions: Vec<u32> = trace.iter().map(|point| point.revision).collect();
        assert_eq!(revisions, (17..=40).collect::<Vec<_>>());
        assert_eq!((trace[23].unknown, traces.revision(id)), (0.5, 40));
        traces.retain(|_| false);
        assert_eq!((traces.of(id), traces.revision(id)), (vec![], 0));
    }
}
