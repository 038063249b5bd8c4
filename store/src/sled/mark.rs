//! The mark: the number of acknowledged commits, in a file beside sled's.
//!
//! If the end of its log is damaged, sled treats the remaining part as complete, tally included;
//! the mark detects this. It is written after the log is durable and before a commit is
//! acknowledged, so that it is never ahead of the log. Two slots are written alternately, so
//! that one is always undamaged. A `kill -9` loses nothing written; against a loss of power it
//! is synced at most every second, since a sync of its own would halve the rate of commits.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::Path;
use std::time::{Duration, Instant};

use crate::private;

/// The file in the database's folder.
pub(super) const MARK_FILE: &str = "mark";
const MAGIC: [u8; 4] = *b"PLPM";
const VERSION: u32 = 1;
/// Length of a slot: magic, version u32, commits u64, CRC-32 of these; little-endian.
const SLOT_BYTES: usize = 20;
/// Offsets of the two slots, in different sectors.
const PLACES: [u64; 2] = [0, 512];
const SYNC_INTERVAL: Duration = Duration::from_secs(1);

/// Content of a mark.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Found {
    /// There is no file.
    Absent,
    /// Neither of the file's slots is undamaged.
    Damaged,
    /// Number of acknowledged commits.
    Commits(u64),
}

/// The open file.
#[derive(Debug)]
pub(super) struct Mark {
    file: File,
    place: usize,
    synced: Instant,
    is_synced: bool,
}

/// Reads the mark of a folder.
pub(super) fn read(folder: &Path) -> io::Result<Found> {
    let mut bytes = Vec::new();
    match File::open(folder.join(MARK_FILE)) {
        Ok(file) => file.take(1024).read_to_end(&mut bytes)?,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Found::Absent),
        Err(error) => return Err(error),
    };
    let places = PLACES.map(|at| at as usize);
    let newest = places.iter().filter_map(|at| commits(bytes.get(*at..*at + SLOT_BYTES)?)).max();
    Ok(newest.map_or(Found::Damaged, Found::Commits))
}

impl Mark {
    /// Opens the mark of a folder, created if missing, and sets it to `commits`.
    pub(super) fn open(folder: &Path, commits: u64) -> io::Result<Self> {
        let path = folder.join(MARK_FILE);
        let file = private::open(&path)?;
        let mut mark = Self { file, place: 0, synced: Instant::now(), is_synced: false };
        for _ in PLACES {
            mark.set(commits)?;
        }
        mark.sync()?;
        File::open(folder)?.sync_all()?;
        Ok(mark)
    }

    /// Notes that this many commits are durable.
    pub(super) fn set(&mut self, commits: u64) -> io::Result<()> {
        let mut slot = Vec::with_capacity(SLOT_BYTES);
        slot.extend_from_slice(&MAGIC);
        slot.extend_from_slice(&VERSION.to_le_bytes());
        slot.extend_from_slice(&commits.to_le_bytes());
        slot.extend_from_slice(&crc32fast::hash(&slot).to_le_bytes());
        self.file.seek(SeekFrom::Start(PLACES[self.place]))?;
        self.file.write_all(&slot)?;
        self.place = (self.place + 1) % PLACES.len();
        self.is_synced = false;
        if self.synced.elapsed() >= SYNC_INTERVAL { self.sync() } else { Ok(()) }
    }

    /// Makes the mark survive a loss of power.
    pub(super) fn sync(&mut self) -> io::Result<()> {
        if !self.is_synced {
            self.file.sync_data()?;
            self.is_synced = true;
        }
        self.synced = Instant::now();
        Ok(())
    }
}

fn commits(slot: &[u8]) -> Option<u64> {
    let (body, checksum) = slot.split_at(SLOT_BYTES - 4);
    let is_whole = crc32fast::hash(body).to_le_bytes() == checksum;
    let head = [&MAGIC[..], &VERSION.to_le_bytes()].concat();
    let is_known = body.starts_with(&head);
    (is_whole && is_known).then(|| u64::from_le_bytes(body[8..16].try_into().unwrap_or_default()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_torn_write_leaves_the_previous_mark() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(read(folder.path()).unwrap(), Found::Absent);
        let mut mark = Mark::open(folder.path(), 3).unwrap();
        mark.set(4).unwrap();
        mark.set(5).unwrap();
        assert_eq!(read(folder.path()).unwrap(), Found::Commits(5));
        let path = folder.path().join(MARK_FILE);
        let whole = std::fs::read(&path).unwrap();
        for place in 0..whole.len() {
            let mut torn = whole.clone();
            torn[place] ^= 0x20;
            std::fs::write(&path, torn).unwrap();
            let found = read(folder.path()).unwrap();
            assert!([Found::Commits(4), Found::Commits(5)].contains(&found), "{place}: {found:?}");
        }
        std::fs::write(&path, &whole[..10]).unwrap();
        assert_eq!(read(folder.path()).unwrap(), Found::Damaged);
    }
}
