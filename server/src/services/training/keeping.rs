//! Simulated touches of a training, kept on the disk until its job ends.
//!
//! Touching meshes takes about half of a training's time. What was touched before a stop of the server
//! is read back when the job goes on. Keeping is a help: without room on the disk, or when a file
//! cannot be used, the training touches as if there were none.

use std::sync::atomic::{AtomicBool, Ordering};

use palpate_core::reading::Reading;
use palpate_core::sensor::SensorDescription;
use palpate_sim::kept::{Cause, Kept, n_bytes};
use palpate_store::database::Database;
use uuid::Uuid;

/// Bytes that must be free beyond the store's reserve. Chosen: the touches of a thousand objects.
const ROOM: u64 = 512 << 20;

/// The touches of one training.
pub(crate) struct Keeping {
    kept: Kept,
    store: Database,
    /// The key that asked for the training, and the bytes that it may hold.
    quota: Option<(Uuid, u64)>,
    is_off: AtomicBool,
}

impl Keeping {
    pub(crate) fn new(kept: Kept, store: Database, quota: Option<(Uuid, u64)>) -> Self {
        Self { kept, store, quota, is_off: AtomicBool::new(false) }
    }

    /// The lists of readings that were kept of this cause.
    pub(super) fn read(
        &self,
        cause: &Cause,
        sensor: &SensorDescription,
    ) -> Option<Vec<Vec<Reading>>> {
        self.kept.read(cause, sensor).unwrap_or_else(|error| {
            tracing::warn!("Cannot read kept touches, they are taken again: {error}");
            None
        })
    }

    /// Keeps lists of readings while there is room.
    pub(super) fn write(&self, cause: &Cause, lists: &[&[Reading]]) {
        if self.is_off.load(Ordering::Relaxed) {
            return;
        }
        let failed = match self.lacks_room(n_bytes(lists)) {
            None => self.kept.write(cause, lists).err().map(|error| error.to_string()),
            Some(reason) => Some(reason.to_owned()),
        };
        if let Some(reason) = failed
            && !self.is_off.swap(true, Ordering::Relaxed)
        {
            tracing::warn!(
                "Further touches of this training are not kept, after a stop they are taken \
                 again: {reason}"
            );
        }
    }

    /// Why there is no room for more bytes: kept touches count to what their key may hold, and to
    /// the disk.
    fn lacks_room(&self, bytes: u64) -> Option<&'static str> {
        let Ok(stats) = self.store.stats() else { return Some("the disk cannot be read") };
        let needed = stats.reserve_bytes.saturating_add(ROOM).saturating_add(bytes);
        if stats.free_bytes.is_some_and(|free| free < needed) {
            return Some("the disk has too little room");
        }
        let (key, quota) = self.quota?;
        let held = self.store.held().get(&key).copied().unwrap_or(0);
        let kept = self.kept.n_bytes().unwrap_or(u64::MAX);
        let is_over = held.saturating_add(kept).saturating_add(bytes) > quota;
        is_over.then_some("the key holds as many bytes as it may")
    }
}
