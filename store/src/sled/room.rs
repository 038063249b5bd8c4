//! Disk space: writes are refused before the disk is full.
//!
//! A sled that meets a full disk in the middle of a write is unusable until it is opened again,
//! and may not open. Therefore a reserve stays free, and commits that would need it are refused.
//! Pure removals may use half of it, and essential commits, such as the revocation of a key,
//! three quarters. A file holds most of the reserve, so that other programs cannot use it up.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::reserve::Reserve;
use crate::engine::{Commit, EngineError};

/// Bytes of log per byte of a commit, at most: pages are rewritten.
const LOG_GROWTH: u64 = 4;
/// Overhead of a commit, bytes.
const COMMIT_BYTES: u64 = 4096;

/// Bytes that are made free beyond what a write needs. Chosen: eight
/// segments of sled's log, of 512 KiB each.
const MARGIN_BYTES: u64 = 4 << 20;

type Probe = dyn Fn(&Path) -> io::Result<u64> + Send + Sync;

/// Source of the number of free bytes at a folder.
#[derive(Clone)]
pub struct FreeSpace {
    probe: Arc<Probe>,
    holds_reserve: bool,
}

impl FreeSpace {
    /// The operating system's number; a file holds most of the reserve.
    #[must_use]
    pub fn of_disk() -> Self {
        Self::from_probe(|folder| fs4::available_space(folder)).holding_reserve()
    }

    /// The number from `probe`, for quotas that the operating system does not know.
    #[must_use]
    pub fn from_probe(probe: impl Fn(&Path) -> io::Result<u64> + Send + Sync + 'static) -> Self {
        Self { probe: Arc::new(probe), holds_reserve: false }
    }

    /// The same number; a file holds most of the reserve.
    #[must_use]
    pub fn holding_reserve(self) -> Self {
        Self { holds_reserve: true, ..self }
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
    folder: PathBuf,
    free_space: FreeSpace,
    pub(super) reserve: u64,
    held: Option<Arc<Reserve>>,
}

/// Bytes that a group of commits may still use.
#[derive(Clone, Copy, Debug)]
pub(super) struct Allowance {
    free: u64,
    reserve: u64,
    taken: u64,
}

impl Room {
    /// The disk of `folder`, before the database in it is open: of a held reserve, as much is freed
    /// as the opening needs.
    pub(super) fn opening(folder: &Path, free_space: &FreeSpace, reserve: u64) -> Self {
        let held = free_space.holds_reserve.then(|| Arc::new(Reserve::found(folder, reserve)));
        let room =
            Self { folder: folder.to_owned(), free_space: free_space.clone(), reserve, held };
        room.make_way(reserve / 4);
        room
    }

    /// The number of free bytes, those of the held reserve included, if known.
    pub(super) fn free(&self) -> Option<u64> {
        Some(self.free_beside()?.saturating_add(self.held.as_ref().map_or(0, |held| held.bytes())))
    }

    /// The number of free bytes beside the held reserve.
    fn free_beside(&self) -> Option<u64> {
        (self.free_space.probe)(&self.folder)
            .inspect_err(|error| tracing::warn!(%error, "Cannot tell how full the disk is"))
            .ok()
    }

    /// Holds the reserve again if there is room for it.
    pub(super) fn hold(&self) {
        if let Some(held) = &self.held
            && let Some(missing) = held.missing()
            && let Some(free) = self.free_beside()
            && free.saturating_sub(missing) >= self.reserve
        {
            held.grow();
        }
    }

    /// Frees what `needed` bytes need of the held reserve.
    fn make_way(&self, needed: u64) {
        if let (Some(held), Some(free)) = (&self.held, self.free_beside()) {
            held.shrink((needed + MARGIN_BYTES).saturating_sub(free));
        }
    }

    /// The allowance of the next group of commits. A disk of unknown size counts as free.
    pub(super) fn allowance(&self) -> Allowance {
        self.hold();
        Allowance { free: self.free().unwrap_or(u64::MAX), reserve: self.reserve, taken: 0 }
    }

    /// Makes the space free that the commits of an allowance took.
    pub(super) fn make_way_for(&self, allowance: &Allowance) {
        if allowance.taken > 0 {
            self.make_way(allowance.taken);
        }
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
