//! Removal of files that `current` does not name: those of before a compaction, and the remains
//! of an interrupted one.
//!
//! A file that cannot be removed is logged and left; the next opening tries again.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use crate::sled::current::{self, Current};
use crate::sled::levels::Levels;

/// Attempts to remove a file: a sled releases its files a moment after it is closed.
const REMOVALS: u32 = 100;
const REMOVAL_PAUSE: Duration = Duration::from_millis(20);

/// Removes the remains of an interrupted compaction from the folder.
pub(in crate::sled) fn remove_leftovers(folder: &Path, current: Current) {
    match current.unnamed(folder) {
        Ok(unnamed) => unnamed.iter().for_each(|path| discard(path)),
        Err(error) => tracing::warn!(%error, "Cannot look for files of old compactions"),
    }
}

/// Removes an unneeded file or folder; the next opening tries again.
pub(super) fn discard(path: &Path) {
    if let Err(error) = current::remove(path) {
        tracing::warn!(%error, "Cannot remove {}", path.display());
    }
}

/// Removes the old files once no reader uses them.
pub(super) fn remove(folder: &Path, current: Current, mut before: Arc<Levels>) {
    loop {
        match Arc::try_unwrap(before) {
            Ok(levels) => break drop(levels),
            Err(read) => before = read,
        }
        std::thread::sleep(REMOVAL_PAUSE);
    }
    for attempt in 1.. {
        let left = current.unnamed(folder).unwrap_or_default();
        let removed = left.iter().try_for_each(|path| current::remove(path));
        match removed {
            Ok(()) if left.is_empty() => return,
            Err(error) if attempt >= REMOVALS => {
                return tracing::warn!(%error, "Cannot remove the files of before a compaction");
            }
            // A sled that was just closed may write once more.
            _ => std::thread::sleep(REMOVAL_PAUSE),
        }
    }
}
