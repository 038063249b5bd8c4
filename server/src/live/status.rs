//! Status of a session according to its journal: open, closed, or expired.
//!
//! Expiry is not a record; it is computed from the time of the last entry, the lifetime and
//! the lease. Ages are measured in running time, so a clock that jumps ends no session.

use palpate_store::database::Database;
use palpate_store::entity::Session;
use palpate_store::error::StoreError;
use palpate_store::running::Running;

use crate::wire::life::{End, EndReason, Status};
use crate::wire::session::options;

/// The status of a session according to its journal.
pub(crate) fn status(
    store: &Database,
    session: &Session,
    running: &Running,
) -> Result<Status, StoreError> {
    let head = store.journal().head(session.id)?;
    // A retraction is not a reading, and removes one.
    let n_others = 2 * head.n_retracted + u64::from(head.is_closed);
    let since = head.last_at_ms.unwrap_or(session.created_at_ms);
    let options = options(session);
    let (leased_until_ms, lives) = (options.leased_until_ms, session.time_to_live_ms > 0);
    let expires_at_ms = lives.then(|| {
        since.saturating_add(session.time_to_live_ms).max(leased_until_ms.unwrap_or_default())
    });
    let leased_ran_ms = leased_until_ms.map(|until| {
        // Earlier releases did not record when a lease was given: it is over when the clock has
        // passed its end.
        let given = options.leased_at_ms.unwrap_or(until).min(until);
        running.at(given).saturating_add((until - given).max(1))
    });
    let expires_ran_ms = lives.then(|| {
        let idle = running.at(since).saturating_add(session.time_to_live_ms);
        idle.max(leased_ran_ms.unwrap_or_default())
    });
    let end = match (expires_at_ms, expires_ran_ms) {
        _ if head.is_closed => {
            let (reason, ran_ms) = (EndReason::Closed, running.at(since));
            Some(End { at_ms: since, ran_ms, reason })
        }
        (Some(at_ms), Some(ran_ms)) if ran_ms <= running.now_ms() => {
            Some(End { at_ms, ran_ms, reason: EndReason::Expired })
        }
        _ => None,
    };
    Ok(Status {
        length: head.length,
        n_readings: head.length.saturating_sub(n_others),
        n_retracted: head.n_retracted,
        changed_at_ms: since,
        end,
        expires_at_ms,
        expires_ran_ms,
        leased_until_ms,
        leased_ran_ms,
    })
}

#[cfg(test)]
mod tests {
    use palpate_store::entity::{Method, StoredReading};
    use palpate_store::journal::{Event, NewEntry};

    use uuid::Uuid;

    use super::*;

    /// Created at 5 s, and lives for 1 s.
    fn session(options: &str) -> Session {
        Session {
            id: Uuid::from_u128(1),
            catalogue: Uuid::nil(),
            version: 1,
            method: Method::Sva,
            sensors: Vec::new(),
            frame_id: String::new(),
            prior: Vec::new(),
            seed: 0,
            time_to_live_ms: 1000,
            options: options.to_owned(),
            created_at_ms: 5000,
            closed_at_ms: None,
        }
    }

    fn end(store: &Database, session: &Session, now: u64) -> Option<(u64, EndReason)> {
        let running = Running::steady(now);
        status(store, session, &running).unwrap().end.map(|end| (end.at_ms, end.reason))
    }

    #[tokio::test]
    async fn a_session_expires_without_readings_in_its_lifetime() {
        let (store, session) = (Database::in_memory(), session(""));
        assert_eq!(end(&store, &session, 5999), None);
        assert_eq!(end(&store, &session, 6000), Some((6000, EndReason::Expired)));
        let reading = Event::Reading(StoredReading {
            sensor: Uuid::nil(),
            session_from_sensor: None,
            pressures: vec![None],
            stamp_ns: None,
            calibration: 0,
            feature: None,
            approach: 0.0,
            object_moved: None,
            contact: None,
            shear: None,
        });
        let entry =
            NewEntry { reading_id: None, received_at_ms: 5900, event: reading, written_by: None };
        store.journal().append(session.id, 0, &[entry]).await.unwrap();
        assert_eq!(end(&store, &session, 6899), None);
        assert_eq!(end(&store, &session, 9000), Some((6900, EndReason::Expired)));
        let entry = NewEntry {
            reading_id: None,
            received_at_ms: 6100,
            event: Event::Closed,
            written_by: None,
        };
        store.journal().append(session.id, 1, &[entry]).await.unwrap();
        assert_eq!(end(&store, &session, 9000), Some((6100, EndReason::Closed)));
    }

    #[tokio::test]
    async fn a_lease_extends_and_never_shortens_a_session() {
        let store = Database::in_memory();
        let leased = session(r#"{"method": "sva", "leased_until_ms": 8000, "leased_at_ms": 5100}"#);
        assert_eq!(end(&store, &leased, 7999), None);
        assert_eq!(end(&store, &leased, 8000), Some((8000, EndReason::Expired)));
        let of_old = session(r#"{"method": "sva", "leased_until_ms": 8000}"#);
        assert_eq!(end(&store, &of_old, 7999), None);
        assert_eq!(end(&store, &of_old, 8001), Some((8000, EndReason::Expired)));
        let long_ago = session(r#"{"method": "sva", "leased_until_ms": 5100}"#);
        assert_eq!(end(&store, &long_ago, 5999), None);
    }
}
