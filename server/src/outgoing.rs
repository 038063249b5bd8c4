//! What a cell has to forward: the sessions that wait, and the state of the line to the central
//! service.
//!
//! Everything here follows from the store, and is found again at a start. Changes of a session note
//! it here, whatever the state of the line. Not here: what is sent (`services`), and the sending,
//! which is outside of this crate.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

use palpate_schemas as wire;
use tokio::sync::Notify;
use uuid::Uuid;

use crate::clock::now_ms;
use crate::config::Forward;
use crate::wire::{count, time};

/// Maximum number of refused sessions, and of sensors, that a status names.
const NAMED_MAX: usize = 100;

/// A session with something that the central service does not have.
#[derive(Clone, Debug, Default)]
struct Waiting {
    since_ms: u64,
    /// Number of entries that wait.
    n_entries: u64,
    /// Number of its changes, to see whether there was one while it was forwarded.
    n_changes: u64,
    /// Why the central service refused it, if it did.
    refused: Option<String>,
}

/// State of the line, and of what comes down on it.
#[derive(Clone, Debug, Default)]
struct Line {
    down_since_ms: Option<u64>,
    last_answer_ms: Option<u64>,
    last_error: Option<String>,
    catalogues: BTreeMap<String, wire::FollowedCatalogue>,
    sensors: BTreeMap<String, String>,
}

/// The waiting sessions of a cell; always empty on other servers.
#[derive(Debug, Default)]
pub(crate) struct Outgoing {
    forward: Option<Forward>,
    waiting: Mutex<BTreeMap<Uuid, Waiting>>,
    line: Mutex<Line>,
    /// Notified of every change.
    pub(crate) wake: Notify,
}

impl Outgoing {
    pub(crate) fn new(forward: Option<Forward>) -> Self {
        Self { forward, ..Self::default() }
    }

    /// Where this cell forwards to; `None` on a server that is no cell.
    pub(crate) fn forward(&self) -> Option<&Forward> {
        self.forward.as_ref()
    }

    /// Notes a change of a session, with a number of new entries of its journal.
    pub(crate) fn note(&self, session: Uuid, n_entries: u64) {
        self.note_since(session, n_entries, now_ms());
    }

    /// The same for a change at another time.
    pub(crate) fn note_since(&self, session: Uuid, n_entries: u64, since_ms: u64) {
        if self.forward.is_none() {
            return;
        }
        let mut waiting = self.waiting();
        let new = || Waiting { since_ms, ..Waiting::default() };
        let entry = waiting.entry(session).or_insert_with(new);
        entry.n_entries += n_entries;
        entry.n_changes += 1;
        drop(waiting);
        self.wake.notify_one();
    }

    /// Drops a session that was deleted.
    pub(crate) fn forget(&self, session: Uuid) {
        self.waiting().remove(&session);
    }

    /// Up to `limit` waiting sessions after `after`, in the order of their creation.
    pub(crate) fn page(&self, after: Option<Uuid>, limit: usize) -> Vec<Uuid> {
        use std::ops::Bound::{Excluded, Unbounded};
        let from = after.map_or(Unbounded, Excluded);
        let waiting = self.waiting();
        waiting.range((from, Unbounded)).take(limit).map(|(id, _)| *id).collect()
    }

    /// Number of changes of a waiting session until now; 0 if it does not wait.
    pub(crate) fn n_changes(&self, session: Uuid) -> u64 {
        self.waiting().get(&session).map_or(0, |waiting| waiting.n_changes)
    }

    /// Notes how many entries of a session still wait.
    pub(crate) fn still_waits(&self, session: Uuid, n_entries: u64) {
        if let Some(waiting) = self.waiting().get_mut(&session) {
            waiting.n_entries = n_entries;
        }
    }

    /// A session was forwarded as it was after `n_changes`: it waits no more, unless it changed.
    pub(crate) fn forwarded(&self, session: Uuid, n_changes: u64) {
        let mut waiting = self.waiting();
        match waiting.get_mut(&session) {
            Some(entry) if entry.n_changes > n_changes => {
                (entry.since_ms, entry.refused) = (now_ms(), None);
            }
            Some(_) => drop(waiting.remove(&session)),
            None => {}
        }
    }

    /// The central service refused a session.
    pub(crate) fn refused(&self, session: Uuid, reason: String) {
        if let Some(waiting) = self.waiting().get_mut(&session) {
            waiting.refused = Some(reason);
        }
    }

    /// The central service answered, whatever it said.
    pub(crate) fn answered(&self) {
        let mut line = self.line();
        (line.last_answer_ms, line.down_since_ms) = (Some(now_ms()), None);
    }

    /// The central service cannot be used; whether it could until now.
    pub(crate) fn failed(&self, error: String) -> bool {
        let mut line = self.line();
        line.last_error = Some(error);
        let was_up = line.down_since_ms.is_none();
        line.down_since_ms.get_or_insert_with(now_ms);
        was_up
    }

    /// Notes the state of a followed catalogue.
    pub(crate) fn catalogue(&self, followed: wire::FollowedCatalogue) {
        self.line().catalogues.insert(followed.name.clone(), followed);
    }

    /// Notes how a sensor differs from the central service's, if it does.
    pub(crate) fn sensor(&self, name: &str, problem: Option<String>) {
        let mut line = self.line();
        match problem {
            Some(problem) => drop(line.sensors.insert(name.to_owned(), problem)),
            None => drop(line.sensors.remove(name)),
        }
    }

    /// The state as clients see it.
    pub(crate) fn shown(&self) -> wire::Forwarding {
        let Some(forward) = &self.forward else { return wire::Forwarding::default() };
        let (line, waiting) = (self.line().clone(), self.waiting());
        let refused = waiting.iter().filter_map(|(id, it)| Some((*id, it.refused.clone()?)));
        let n_refused = waiting.values().filter(|it| it.refused.is_some()).count();
        let followed = |name: &String| {
            let new = || wire::FollowedCatalogue { name: name.clone(), ..Default::default() };
            line.catalogues.get(name).cloned().unwrap_or_else(new)
        };
        wire::Forwarding {
            to: Some(forward.to.clone()),
            cell: Some(forward.cell.clone()),
            down_since: line.down_since_ms.map(time),
            last_answer_at: line.last_answer_ms.map(time),
            last_error: line.last_error,
            sessions_waiting: count(waiting.len()),
            entries_waiting: waiting.values().map(|it| it.n_entries).sum(),
            oldest_waiting_since: waiting.values().map(|it| it.since_ms).min().map(time),
            sessions_refused: count(n_refused),
            refused: refused
                .take(NAMED_MAX)
                .map(|(session, reason)| wire::RefusedSession { session, reason })
                .collect(),
            catalogues: forward.catalogues.iter().map(followed).collect(),
            sensors: line
                .sensors
                .into_iter()
                .take(NAMED_MAX)
                .map(|(name, problem)| wire::DifferentSensor { name, problem })
                .collect(),
        }
    }

    /// Updates the metrics.
    pub(crate) fn measure(&self) {
        if self.forward.is_none() {
            return;
        }
        let now = now_ms();
        let seconds = |since: Option<u64>| {
            since.map_or(0.0, |since| now.saturating_sub(since) as f64 / 1000.0)
        };
        let down = seconds(self.line().down_since_ms);
        let waiting = self.waiting();
        let n_refused = waiting.values().filter(|it| it.refused.is_some()).count();
        let n_entries: u64 = waiting.values().map(|it| it.n_entries).sum();
        let oldest = seconds(waiting.values().map(|it| it.since_ms).min());
        metrics::gauge!("palpate_forwarding_down_seconds").set(down);
        metrics::gauge!("palpate_forwarding_sessions_waiting").set(waiting.len() as f64);
        metrics::gauge!("palpate_forwarding_entries_waiting").set(n_entries as f64);
        metrics::gauge!("palpate_forwarding_sessions_refused").set(n_refused as f64);
        metrics::gauge!("palpate_forwarding_oldest_waiting_seconds").set(oldest);
    }

    fn waiting(&self) -> MutexGuard<'_, BTreeMap<Uuid, Waiting>> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn line(&self) -> MutexGuard<'_, Line> {
        self.line.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outgoing() -> Outgoing {
        let (to, cell) = ("http://hub:7411".to_owned(), "cell-7".to_owned());
        Outgoing::new(Some(Forward { to, cell, catalogues: vec!["default".to_owned()] }))
    }

    #[test]
    fn a_change_during_forwarding_keeps_a_session_waiting() {
        let (outgoing, id) = (outgoing(), Uuid::from_u128(7));
        outgoing.note_since(id, 3, 1000);
        let seen = outgoing.n_changes(id);
        outgoing.note(id, 1);
        outgoing.still_waits(id, 1);
        outgoing.forwarded(id, seen);
        let shown = outgoing.shown();
        assert_eq!((shown.sessions_waiting, shown.entries_waiting), (1, 1));
        outgoing.forwarded(id, outgoing.n_changes(id));
        assert_eq!(outgoing.shown().sessions_waiting, 0);
        assert!(outgoing.page(None, 9).is_empty());
    }

    #[test]
    fn the_line_is_down_since_its_first_failure_until_an_answer() {
        let outgoing = outgoing();
        assert!(outgoing.failed("cannot reach it".to_owned()));
        let since = outgoing.shown().down_since;
        assert!(since.is_some());
        assert!(!outgoing.failed("still not".to_owned()));
        assert_eq!(outgoing.shown().down_since, since);
        outgoing.answered();
        let shown = outgoing.shown();
        assert_eq!((shown.down_since, shown.last_error.as_deref()), (None, Some("still not")));
    }

    #[test]
    fn refused_sessions_are_named_and_other_servers_have_none() {
        let (outgoing, id) = (outgoing(), Uuid::from_u128(7));
        outgoing.note(id, 2);
        outgoing.refused(id, "there is no version 4".to_owned());
        let shown = outgoing.shown();
        assert_eq!((shown.sessions_refused, shown.refused[0].session), (1, id));
        assert_eq!(shown.refused[0].reason, "there is no version 4");
        let none = Outgoing::new(None);
        none.note(id, 2);
        assert_eq!(none.shown(), wire::Forwarding::default());
    }
}
