//! The file that holds most of the disk's reserve, so that no other program fills it.
//!
//! It has three quarters of the reserve: commits that may not use the reserve need the last quarter
//! on the disk itself. It shrinks by what an essential commit or a removal needs, and grows again
//! when there is room. Its content means nothing. Where the file system cannot hold space for a file,
//! the reserve is only a comparison.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use fs4::FileExt;

use crate::private;

const FILE: &str = "reserve";

/// The file and its length.
#[derive(Debug)]
pub(super) struct Reserve {
    path: PathBuf,
    whole: u64,
    bytes: AtomicU64,
    /// Whether the file system has refused to hold it, until the next start.
    is_refused: AtomicBool,
}

impl Reserve {
    /// The file in `folder`, as long as it is now.
    pub(super) fn found(folder: &Path, reserve: u64) -> Self {
        let path = folder.join(FILE);
        let bytes = path.metadata().map_or(0, |file| file.len());
        Self { path, whole: reserve / 4 * 3, bytes: bytes.into(), is_refused: false.into() }
    }

    /// Number of bytes held.
    pub(super) fn bytes(&self) -> u64 {
        self.bytes.load(Ordering::Relaxed)
    }

    /// Number of bytes to hold beside those held; `None` if it is whole, or cannot be.
    pub(super) fn missing(&self) -> Option<u64> {
        let is_open = self.bytes() != self.whole && !self.is_refused.load(Ordering::Relaxed);
        is_open.then(|| self.whole.saturating_sub(self.bytes()))
    }

    /// Holds all of it.
    pub(super) fn grow(&self) {
        let grown = private::open(&self.path).and_then(|file| {
            file.set_len(self.bytes().min(self.whole))?;
            file.allocate(self.whole)
        });
        match grown {
            Ok(()) => self.bytes.store(self.whole, Ordering::Relaxed),
            Err(error) => {
                tracing::warn!(%error, "Cannot hold the disk's reserve: {error}");
                self.is_refused.store(true, Ordering::Relaxed);
                self.shrink(u64::MAX);
            }
        }
    }

    /// Frees up to `bytes` of it.
    pub(super) fn shrink(&self, bytes: u64) {
        let left = self.bytes().saturating_sub(bytes);
        if left == self.bytes() {
            return;
        }
        match private::open(&self.path).and_then(|file| file.set_len(left)) {
            Ok(()) => self.bytes.store(left, Ordering::Relaxed),
            Err(error) => tracing::warn!(%error, "Cannot free the disk's reserve: {error}"),
        }
    }
}
