//! What a session is doing, as its journal says.

use palpate_store::database::Database;
use palpate_store::entity::Session;
use palpate_store::journal::Event;

use crate::refusal::Refusal;
use crate::wire::session::Status;

/// What a session is doing, by its journal.
pub(crate) fn status(store: &Database, session: &Session, now: u64) -> Result<Status, Refusal> {
    let journal = store.journal();
    let length = journal.len(session.id)?;
    let last = match length.checked_sub(1) {
        Some(last) => journal.entry(session.id, last)?,
        None => None,
    };
    let n_retracted = journal.retractions(session.id)?.len() as u64;
    let is_closed = last.as_ref().is_some_and(|last| last.event == Event::Closed);
    // A retraction is no reading, and takes one away.
    let n_others = 2 * n_retracted + u64::from(is_closed);
    let since = last.map_or(session.created_at_ms, |last| last.received_at_ms);
    let expires = since.saturating_add(session.time_to_live_ms);
    let is_expired = session.time_to_live_ms > 0 && now >= expires;
    let closed_at_ms = if is_closed { Some(since) } else { is_expired.then_some(expires) };
    Ok(Status { length, n_readings: length.saturating_sub(n_others), n_retracted, closed_at_ms })
}

#[cfg(test)]
mod tests {
    use palpate_store::entity::{Method, StoredReading};
    use palpate_store::journal::NewEntry;

    use uuid::Uuid;

    use super::*;

    #[tokio::test]
    async fn a_session_closes_when_nothing_new_comes_for_its_time_to_live() {
        let store = Database::in_memory();
        let session = Session {
            id: Uuid::from_u128(1),
            catalogue: Uuid::nil(),
            version: 1,
            method: Method::Sva,
            sensors: Vec::new(),
            frame_id: String::new(),
            prior: Vec::new(),
            object_may_move: false,
            seed: 0,
            time_to_live_ms: 1000,
            options: String::new(),
            created_at_ms: 5000,
            closed_at_ms: None,
        };
        let closed_at = |now| status(&store, &session, now).unwrap().closed_at_ms;
        assert_eq!((closed_at(5999), closed_at(6000)), (None, Some(6000)));
        let reading = Event::Reading(StoredReading {
            sensor: Uuid::nil(),
            session_from_sensor: None,
            pressures: vec![None],
            stamp_ns: None,
            calibration: 0,
            feature: None,
            approach: 0.0,
            object_moved: None,
        });
        let entry = NewEntry { reading_id: None, received_at_ms: 5900, event: reading };
        store.journal().append(session.id, 0, &[entry]).await.unwrap();
        assert_eq!((closed_at(6899), closed_at(9000)), (None, Some(6900)));
    }
}
