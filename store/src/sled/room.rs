//! Disk space: writes are refused before the disk is full.
//!
//! A sled that meets a full disk in the middle of a write is unusable until it is opened again,
//! and may not open. Therefore a reserve stays free, and commits that would need it are refused.
//! Pure removals may use half of it, and essential commits, such as the revocation of a key,
//! three quarters.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::engine::{Commit, EngineError};

/// Bytes of log per byte of a commit, at most: pages are rewritten.
const LOG_GROWTH: u64 = 4;
/// Overhead of a commit, bytes.
const COMMIT_BYTES: u64 = 4096;

type Probe = dyn Fn(&Path) -> io::Result<u64> + Send + Sync;

/// Source of the number of free bytes at a folder.
#[derive(Clone)]
pub struct FreeSpace(Arc<Probe>);

impl FreeSpace {
    /// The operating system's number.
    #[must_use]
    pub fn of_disk() -> Self {
        Self::from_probe(|folder| fs4::available_space(folder))
    }

    /// The number from `probe`, for quotas that the operating system does not know.
    #[must_use]
    pub fn from_probe(probe: impl Fn(&Path) -> io::Result<u64> + Send + Sync + 'static) -> Self {
        Self(Arc::new(probe))
    }
}

impl fmt::Debug for FreeSpace {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("FreeSpace")
    }
}

/// The disk of a folder, and its reserve.
#[derive(Clone, Debug)]
pub(super) struct Room {
    pub(super) folder: PathBuf,
    pub(super) free_space: FreeSpace,
    pub(super) reserve: u64,
}

/// Bytes that a group of commits may still use.
#[derive(Clone, Copy, Debug)]
pub(super) struct Allowance {
    free: u64,
    reserve: u64,
    taken: u64,
}

impl Room {
    /// The number of free bytes, if known.
    pub(super) fn free(&self) -> Option<u64> {
        (self.free_space.0)(&self.folder)
            .inspect_err(|error| tracing::warn!(%error, "Cannot tell how full the disk is"))
            .ok()
    }

    /// The allowance of the next group of commits. A disk of unknown size counts as free.
    pub(super) fn allowance(&self) -> Allowance {
        Allowance { free: self.free().unwrap_or(u64::MAX), reserve: self.reserve, taken: 0 }
    }
}

impl Allowance {
    /// Takes the space of a commit.
    pub(super) fn take(&mut self, commit: &Commit) -> Result<(), EngineError> {
        let size = |(key, value): &(Vec<u8>, Option<Vec<u8>>)| {
            key.len() + value.as_ref().map_or(0, Vec::len)
        };
        let bytes: usize = commit.writes.iter().map(size).sum();
        let needed = self.taken + COMMIT_BYTES + LOG_GROWTH * bytes as u64;
        let only_removes = commit.writes.iter().all(|(_, value)| value.is_none());
        let stays = match (commit.is_essential, only_removes) {
            (true, _) => self.reserve / 4,
            (false, true) => self.reserve / 2,
            (false, false) => self.reserve,
        };
        if self.free.saturating_sub(needed) < stays {
            return Err(EngineError::Full { free: self.free, reserve: self.reserve });
        }
        self.taken = needed;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_removals_and_essential_commits_use_the_reserve() {
        let allowance = |free| Allowance { free, reserve: 1 << 20, taken: 0 };
        let put = Commit::new().put(vec![1; 10], vec![0; 1014]);
        let removal = Commit::new().remove(vec![1; 10]);
        // 4096 + 4 × 1024 bytes.
        assert_eq!(allowance((1 << 20) + 8192).take(&put), Ok(()));
        let full = EngineError::Full { free: (1 << 20) + 8191, reserve: 1 << 20 };
        assert_eq!(allowance((1 << 20) + 8191).take(&put), Err(full));
        assert_eq!(allowance(600 << 10).take(&removal), Ok(()));
        assert!(allowance(512 << 10).take(&removal).is_err());
        let essential = Commit { is_essential: true, ..put.clone() };
        assert_eq!(allowance((256 << 10) + 8192).take(&essential), Ok(()));
        assert!(allowance((256 << 10) + 8191).take(&essential).is_err());
        let mut shared = allowance((1 << 20) + 16_384);
        assert_eq!((shared.take(&put), shared.take(&put)), (Ok(()), Ok(())));
        assert!(shared.take(&put).is_err(), "a group shares what is left");
    }
}
