//! Entries that a cell forwards: each gets the number that it has in the cell's journal, once.
//!
//! The number makes a repetition harmless, also for readings without an id. No other client writes
//! to such a session, so the two journals stay equal.

use palpate_schemas as wire;
use palpate_schemas::BeliefDetail;
use palpate_store::journal::{AppendError, Entry, Event, NewEntry};
use uuid::Uuid;

use super::{Live, LiveError};
use crate::asker::Asker;
use crate::cause::Cause;
use crate::clock::now_ms;
use crate::wire::count;
use crate::wire::forwarding::Forwarded;
use crate::wire::session::options;

/// Maximum number of times that other servers may be faster with a session.
const OVERTAKEN_MAX: usize = 64;

impl Live {
    /// Appends the entries from number `from` on, except those that are there already.
    pub(crate) async fn forward(
        &self,
        from: u64,
        entries: &[Forwarded],
    ) -> Result<wire::EntriesForwarded, LiveError> {
        let session = self.session.id;
        if options(&self.session).cell.is_none() {
            return Err(LiveError::NotForwarded { session });
        }
        let mut state = self.turns.take().await?;
        let mut attempts = OVERTAKEN_MAX;
        let (length, n_new) = loop {
            let (length, new) = self.missing(from, entries)?;
            if new.is_empty() {
                break (length, 0);
            }
            let written: Vec<NewEntry> = new.iter().map(entry_of).collect();
            match self.tools.store.journal().append(session, length, &written).await {
                Err(AppendError::Sequence { .. }) if attempts > 0 => attempts -= 1,
                Err(error @ AppendError::Retracted { .. }) => {
                    return Err(Cause::field("/entries", error).into());
                }
                appended => {
                    appended?;
                    break (length, new.len() as u64);
                }
            }
        };
        if n_new > 0 {
            metrics::counter!("palpate_readings_total").increment(n_readings(entries, n_new));
            if let Some(place) = self.place(BeliefDetail::None)? {
                let handed = (Vec::new(), now_ms());
                self.renew(&mut state, handed, place, length + n_new).await?;
            }
        }
        let revision = count(length + n_new);
        let readings = entries.iter().filter_map(|entry| match entry {
            Forwarded::Reading(incoming) => Some(incoming.as_ref()),
            Forwarded::Retraction(_) => None,
        });
        let warnings = self.warned(readings)?;
        Ok(wire::EntriesForwarded { session, n_new: count(n_new), revision, warnings })
    }

    /// The length of the journal, and the entries that it does not have yet.
    fn missing<'e>(
        &self,
        from: u64,
        entries: &'e [Forwarded],
    ) -> Result<(u64, &'e [Forwarded]), LiveError> {
        let (session, status) = (self.session.id, self.status(now_ms())?);
        let journal = self.tools.store.journal();
        let is_closed = journal.head(session)?.is_closed;
        let length = status.length - u64::from(is_closed);
        if from > length {
            return Err(LiveError::Gap { session, from, length });
        }
        let n_known = (length - from).min(entries.len() as u64) as usize;
        let known = journal.entries(session, from, n_known)?;
        for (stored, given) in known.iter().zip(entries) {
            if !is_same(stored, given) {
                return Err(LiveError::OtherEntry { session, number: stored.seq });
            }
        }
        let new = &entries[n_known..];
        if new.is_empty() {
            return Ok((length, new));
        }
        if let Some(end) = status.end {
            return Err(LiveError::Ended { session, end });
        }
        let (found, max) = (status.n_stored(), self.tools.readings_max);
        let more = new.iter().filter(|entry| matches!(entry, Forwarded::Reading(_))).count();
        if found + more as u64 > max as u64 {
            return Err(Cause::ReadingsFull { what: "session", found, more, max }.into());
        }
        for (index, entry) in entries.iter().enumerate().skip(n_known) {
            if let Forwarded::Retraction(number) = entry {
                self.check_retraction(*number, (from, index), entries)?;
            }
        }
        Ok((length, new))
    }

    /// Refuses the retraction of what is no earlier reading.
    fn check_retraction(
        &self,
        number: u64,
        (from, index): (u64, usize),
        entries: &[Forwarded],
    ) -> Result<(), LiveError> {
        let is_reading = if number >= from {
            let place = (number - from) as usize;
            place < index && matches!(entries[place], Forwarded::Reading(_))
        } else {
            let entry = self.tools.store.journal().entry(self.session.id, number)?;
            entry.is_some_and(|entry| matches!(entry.event, Event::Reading(_)))
        };
        if is_reading {
            return Ok(());
        }
        let detail = format!("came {number}, expected the number of an earlier reading");
        Err(Cause::field(format!("/entries/{index}/retracts"), detail).into())
    }

    /// Refuses changes by others than the cell that forwards the session.
    pub(super) fn check_writer(&self) -> Result<(), LiveError> {
        match options(&self.session).cell {
            Some(cell) => Err(LiveError::OfCell { session: self.session.id, cell }),
            None => Ok(()),
        }
    }
}

fn is_same(stored: &Entry, given: &Forwarded) -> bool {
    match (&stored.event, given) {
        (Event::Reading(reading), Forwarded::Reading(incoming)) => {
            reading.is_repeated_by(&incoming.stored) && stored.reading_id == incoming.id
        }
        (Event::Retraction { seq }, Forwarded::Retraction(number)) => seq == number,
        _ => false,
    }
}

/// Number of readings among the last `n_new` entries.
fn n_readings(entries: &[Forwarded], n_new: u64) -> u64 {
    let new = entries.iter().rev().take(n_new as usize);
    new.filter(|entry| matches!(entry, Forwarded::Reading(_))).count() as u64
}

fn entry_of(entry: &Forwarded) -> NewEntry {
    let (received_at_ms, key): (u64, Option<Uuid>) = (now_ms(), Asker::current().key());
    match entry {
        Forwarded::Reading(incoming) => incoming.entry(received_at_ms, key),
        Forwarded::Retraction(seq) => NewEntry {
            reading_id: None,
            received_at_ms,
            event: Event::Retraction { seq: *seq },
            written_by: key,
        },
    }
}
