//! Keys and robots' names on servers that share a store.
//!
//! Their rules concern all of them (a name is taken once, an admin key is left), so one server at
//! a time changes them, after it has read what the others did. Changes of others are also heard.

use std::collections::BTreeMap;
use std::sync::PoisonError;
use std::time::Duration;

use palpate_store::access::AccessKey;
use palpate_store::database::Database;
use palpate_store::engine::EngineError;
use palpate_store::engine::lease::Lease;
use palpate_store::error::StoreError;
use tokio::sync::MutexGuard;
use uuid::Uuid;

use super::Keys;

/// Time to wait for another server that changes keys. Chosen: one that died meanwhile keeps others
/// waiting for 20 s.
const ALONE_WITHIN: Duration = Duration::from_secs(30);

/// The right to change keys, within this server and among all.
pub(super) struct Alone<'keys> {
    _within: MutexGuard<'keys, ()>,
    _among: Lease,
}

/// The right to change keys among all servers.
pub(super) async fn alone(store: &Database) -> Result<Lease, EngineError> {
    store.alone("changing keys", ALONE_WITHIN).await
}

/// All keys of a store.
pub(super) fn read_keys(store: &Database) -> Result<BTreeMap<Uuid, AccessKey>, StoreError> {
    Ok(store.keys().all()?.into_iter().map(|key| (key.id, key)).collect())
}

impl Keys {
    /// Waits for the right to change keys; all changes of others are known then.
    pub(super) async fn alone(&self) -> Result<Alone<'_>, StoreError> {
        let within = self.changing.lock().await;
        let among = alone(&self.store).await?;
        if self.store.is_shared() {
            self.heard_all()?;
        }
        Ok(Alone { _within: within, _among: among })
    }

    /// Looks again at a key that another server changed.
    pub(crate) fn heard(&self, id: Uuid) -> Result<(), StoreError> {
        {
            // Read under the lock: what this server stores meanwhile is learnt later.
            let mut known = self.known.write().unwrap_or_else(PoisonError::into_inner);
            match self.store.keys().find(id)? {
                Some(key) => known.insert(id, key),
                None => known.remove(&id),
            };
        }
        self.changes.send_replace(());
        Ok(())
    }

    /// Looks again at the owner of a robot's name.
    pub(crate) fn heard_robot(&self, robot: &str) -> Result<(), StoreError> {
        let mut holders = self.holders.write().unwrap_or_else(PoisonError::into_inner);
        match self.store.robots().find(robot)? {
            Some(holder) => holders.insert(robot.to_owned(), holder),
            None => holders.remove(robot),
        };
        Ok(())
    }

    /// Looks again at all keys and names. Blocks.
    pub(crate) fn heard_all(&self) -> Result<(), StoreError> {
        {
            let mut known = self.known.write().unwrap_or_else(PoisonError::into_inner);
            *known = read_keys(&self.store)?;
            let mut holders = self.holders.write().unwrap_or_else(PoisonError::into_inner);
            *holders = Self::read_robots(&self.store)?;
        }
        self.changes.send_replace(());
        Ok(())
    }
}
