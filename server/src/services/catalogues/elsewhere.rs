//! Catalogues on servers that share a store: one of them at a time publishes or removes versions,
//! since a removal drops the blocks that no version names.

use std::time::Duration;

use palpate_store::engine::lease::Lease;
use palpate_store::error::StoreError;
use tokio::sync::MutexGuard;
use uuid::Uuid;

use super::Catalogues;

/// Time to wait for another server that publishes or removes. Chosen: a training must not be lost
/// because another server stores a version of gigabytes.
const ALONE_WITHIN: Duration = Duration::from_secs(600);

/// The right to publish and remove versions, within this server and among all.
pub(super) struct Alone<'catalogues> {
    _within: MutexGuard<'catalogues, ()>,
    _among: Lease,
}

impl Catalogues {
    /// Waits for the right to publish and remove versions.
    pub(super) async fn alone(&self) -> Result<Alone<'_>, StoreError> {
        let within = self.publishing.lock().await;
        let among = self.store.essential().alone("changing catalogues", ALONE_WITHIN).await?;
        Ok(Alone { _within: within, _among: among })
    }

    /// Looks again at a version that another server published or removed.
    pub(crate) fn heard(&self, catalogue: Uuid, version: u32) -> Result<(), StoreError> {
        match self.table.manifest(catalogue, version) {
            Err(StoreError::NoVersion { .. }) => {
                self.damaged.remove(&(catalogue, version));
                Ok(())
            }
            other => other.map(drop),
        }
    }
}
