//! The end of an accepted key, with which the streams of its holder end.
//!
//! A key ends when it is revoked, when it expires, and, for the holder of a replaced secret,
//! when the grace period of that secret is over.

use std::time::Duration;

use palpate_store::access::AccessKey;

use super::Keys;

/// Maximum time between two readings of the clock, which may be set.
const LOOK_EVERY: Duration = Duration::from_secs(60);

impl Keys {
    /// Returns when the key, in the state in which it was accepted, is no longer valid.
    pub(crate) async fn until_refused(&self, admitted: AccessKey) {
        let admitted_at_ms = self.now_ms();
        let mut changes = self.changes.subscribe();
        loop {
            changes.borrow_and_update();
            let stored = self.find_id(admitted.id);
            let end_ms =
                stored.map_or(Some(0), |stored| end_ms(&stored, &admitted, admitted_at_ms));
            let now = self.now_ms();
            if end_ms.is_some_and(|end| end <= now) {
                return;
            }
            let rest = end_ms.map_or(LOOK_EVERY, |end| Duration::from_millis(end - now));
            tokio::select! {
                () = tokio::time::sleep(rest.min(LOOK_EVERY)) => {}
                Ok(()) = changes.changed() => {}
            }
        }
    }
}

/// The time at which a key accepted in an earlier state ends; `None` if it is unknown.
///
/// If a secret had a grace period at that time, it is unknown which secret was used, so the
/// holder has to reconnect when the period is over.
fn end_ms(stored: &AccessKey, admitted: &AccessKey, admitted_at_ms: u64) -> Option<u64> {
    if stored.revoked_at_ms.is_some() {
        return Some(0);
    }
    let previous = stored.previous.as_ref();
    let secret_ends = if stored.hash == admitted.hash {
        previous.map(|previous| previous.until_ms).filter(|&until| until > admitted_at_ms)
    } else {
        let graced = previous.filter(|previous| previous.hash == admitted.hash);
        Some(graced.map_or(0, |previous| previous.until_ms))
    };
    [secret_ends, stored.expires_at_ms].into_iter().flatten().min()
}

#[cfg(test)]
mod tests {
    use palpate_store::access::{PreviousSecret, Role};
    use uuid::Uuid;

    use super::*;

    fn key(hash: u8, previous: Option<(u8, u64)>) -> AccessKey {
        AccessKey {
            id: Uuid::nil(),
            name: "arm".to_owned(),
            role: Role::Robot,
            hash: [hash; 32],
            previous: previous
                .map(|(hash, until_ms)| PreviousSecret { hash: [hash; 32], until_ms }),
            created_at_ms: 0,
            expires_at_ms: None,
            last_used_at_ms: None,
            revoked_at_ms: None,
        }
    }

    #[test]
    fn a_key_ends_with_its_revocation_expiry_or_secret() {
        let admitted = key(1, None);
        let end = |stored: AccessKey| end_ms(&stored, &admitted, 100);
        assert_eq!(end(key(1, None)), None);
        assert_eq!(end(AccessKey { revoked_at_ms: Some(150), ..key(1, None) }), Some(0));
        assert_eq!(end(AccessKey { expires_at_ms: Some(900), ..key(1, None) }), Some(900));
        assert_eq!(end(key(2, Some((1, 700)))), Some(700), "its secret has a grace");
        assert_eq!(end(key(3, Some((2, 700)))), Some(0), "rotated twice");
        let expiring = AccessKey { expires_at_ms: Some(300), ..key(2, Some((1, 700))) };
        assert_eq!(end(expiring), Some(300));
        assert_eq!(end(key(1, Some((9, 700)))), Some(700), "which of the two is not known");
        assert_eq!(end(key(1, Some((9, 99)))), None, "the grace was over before");
    }
}
