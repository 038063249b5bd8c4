//! Simulated touches of a training, kept on the disk until its job ends.
//!
//! Touching meshes takes about half of a training's time. What was touched before a stop of the server
//! is read back when the job goes on. Keeping is a help: without room on the disk, or when a file
//! cannot be used, the training touches as if there were none.

use std::sync::atomic::{AtomicBool, Ordering};

use palpate_core::reading::Reading;
use palpate_core::sensor::SensorDescription;
use palpate_sim::kept::{Cause, Kept};
use palpate_store::database::Database;

/// Bytes that must be free beyond the store's reserve. Chosen: the touches of a thousand objects.
const ROOM: u64 = 512 << 20;

/// The touches of one training.
pub(crate) struct Keeping {
    kept: Kept,
    store: Database,
    is_off: AtomicBool,
}

impl Keeping {
    pub(crate) fn new(kept: Kept, store: Database) -> Self {
        Self { kept, store, is_off: AtomicBool::new(false) }
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
        let failed = match self.has_room() {
            true => self.kept.write(cause, lists).err().map(|error| error.to_string()),
            false => Some("the disk has too little room".to_owned()),
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

    fn has_room(&self) -> bool {
        let Ok(stats) = self.store.stats() else { return false };
        stats.free_bytes.is_none_or(|free| free >= stats.reserve_bytes.saturating_add(ROOM))
    }
}
