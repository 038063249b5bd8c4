//! The cache of content: objects that were read, in temporary files of bounded size.
//!
//! Its files have no name and vanish with the process. The file that was not read for the
//! longest time goes when there is no more room; its objects are then fetched again.

use std::fs::File;
use std::io;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

/// Bytes of a file. Chosen: what goes at once is far less than the cache, and 64 files are few.
const SEGMENT_BYTES: u64 = 16 << 20;
/// Maximum bytes of all files. Chosen: a disk of a server has as much, and what a server holds of
/// a catalogue in memory is read once; the meshes and the blocks that are read again fit.
const CACHE_BYTES_MAX: u64 = 1 << 30;

/// A file of the cache.
#[derive(Debug)]
struct Segment {
    file: File,
    /// Tick of the last use.
    used: AtomicU64,
}

/// Bytes that are in the cache as long as this exists.
#[derive(Clone, Debug)]
pub(super) struct Kept {
    segment: Arc<Segment>,
    at: u64,
}

/// Bytes that may be in the cache.
#[derive(Clone, Debug)]
pub(super) struct Perhaps {
    segment: Weak<Segment>,
    at: u64,
}

impl Kept {
    /// The bytes, as long as they stay in the cache.
    pub(super) fn perhaps(&self) -> Perhaps {
        Perhaps { segment: Arc::downgrade(&self.segment), at: self.at }
    }
}

impl Perhaps {
    /// The bytes, if they still are in the cache.
    pub(super) fn kept(&self) -> Option<Kept> {
        let segment = self.segment.upgrade()?;
        Some(Kept { segment, at: self.at })
    }
}

/// The cache.
#[derive(Debug)]
pub(super) struct Cache {
    folder: PathBuf,
    bytes_max: u64,
    /// Number of uses so far.
    tick: AtomicU64,
    files: Mutex<Files>,
}

#[derive(Debug, Default)]
struct Files {
    /// The last one takes new bytes.
    segments: Vec<Arc<Segment>>,
    /// End of the last one.
    end: u64,
}

impl Cache {
    /// A cache with files in `folder`, which exists.
    pub(super) fn new(folder: &Path) -> Self {
        let (folder, bytes_max) = (folder.to_owned(), CACHE_BYTES_MAX);
        Self { folder, bytes_max, tick: AtomicU64::new(0), files: Mutex::default() }
    }

    fn files(&self) -> MutexGuard<'_, Files> {
        self.files.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes bytes, and lets others go if they need the room.
    pub(super) fn keep(&self, bytes: &[u8]) -> io::Result<Kept> {
        let mut files = self.files();
        let is_full = files.end + bytes.len() as u64 > SEGMENT_BYTES;
        if files.segments.is_empty() || (is_full && files.end > 0) {
            let file = unnamed_file(&self.folder)?;
            let segment = Segment { file, used: AtomicU64::new(self.tick()) };
            files.segments.push(Arc::new(segment));
            files.end = 0;
            while files.segments.len() as u64 * SEGMENT_BYTES > self.bytes_max
                && files.segments.len() > 1
            {
                let others = files.segments[..files.segments.len() - 1].iter().enumerate();
                let oldest = others.min_by_key(|(_, other)| other.used.load(Ordering::Relaxed));
                let Some((oldest, _)) = oldest else { break };
                files.segments.remove(oldest);
            }
        }
        let Some(segment) = files.segments.last().map(Arc::clone) else {
            return Err(io::Error::other("the cache has no file"));
        };
        let at = files.end;
        segment.file.write_all_at(bytes, at)?;
        files.end += bytes.len() as u64;
        Ok(Kept { segment, at })
    }

    /// Reads `length` bytes at an offset of what was kept.
    pub(super) fn read(&self, kept: &Kept, at: u32, length: usize) -> io::Result<Vec<u8>> {
        kept.segment.used.store(self.tick(), Ordering::Relaxed);
        let mut bytes = vec![0; length];
        kept.segment.file.read_exact_at(&mut bytes, kept.at + u64::from(at))?;
        Ok(bytes)
    }

    fn tick(&self) -> u64 {
        self.tick.fetch_add(1, Ordering::Relaxed)
    }

    /// Bytes that its files take at most.
    pub(super) fn bytes(&self) -> u64 {
        let files = self.files();
        (files.segments.len() as u64).saturating_sub(1) * SEGMENT_BYTES + files.end
    }
}

/// A file without a name, which is usable while it is open.
pub(super) fn unnamed_file(folder: &Path) -> io::Result<File> {
    let path = folder.join(format!("spool-{}", uuid::Uuid::now_v7()));
    let file = File::options().read(true).write(true).create_new(true).open(&path)?;
    std::fs::remove_file(&path)?;
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_not_read_for_longest_goes_first() {
        let folder = tempfile::tempdir().expect("the folder can be made");
        let cache = Cache { bytes_max: 3 * SEGMENT_BYTES, ..Cache::new(folder.path()) };
        let large = |number: u8| vec![number; SEGMENT_BYTES as usize - 5];
        let keep = |number| cache.keep(&large(number)).expect("the disk has room").perhaps();
        let kept: Vec<Perhaps> = (0..3).map(keep).collect();
        assert!(kept.iter().all(|kept| kept.kept().is_some()));
        let first = kept[0].kept().expect("it is there");
        assert_eq!(cache.read(&first, 3, 2).expect("it was written"), [0, 0]);
        let small = cache.keep(&[7, 8, 9, 10]).expect("it fits behind the last");
        assert_eq!(cache.read(&small, 1, 2).expect("it was written"), [8, 9]);
        drop((first, small));
        let last = keep(4);
        let left: Vec<bool> = kept.iter().map(|kept| kept.kept().is_some()).collect();
        assert_eq!(left, [true, false, true], "the second was not read for longest");
        assert!(last.kept().is_some() && cache.bytes() <= 3 * SEGMENT_BYTES);
        let names = std::fs::read_dir(folder.path()).expect("the folder exists").count();
        assert_eq!(names, 0, "no file has a name");
    }
}
