//! Opening of a database: the folder's lock, the levels, and the check against the last writes.

use std::fs::{self, File, OpenOptions};
use std::io;
use std::ops::Bound;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use fs4::FileExt;

use super::base::Base;
use super::current::{Current, base_file, sled_folder};
use super::levels::{Form, Layer, Levels};
use super::mark::{self, Found};
use super::tally::{Contents, TALLY_KEY, Tally};
use super::{SledOptions, census, guarded};
use crate::engine::opening::OpenError;
use crate::engine::{EngineError, Pair};
use crate::holding::Held;
use crate::key::{self, Space};

/// The lock file of the folder.
const LOCK_FILE: &str = "lock";
/// Folder for files that sled can rebuild and fails to open with.
const ASIDE_FOLDER: &str = "aside";
/// Attempts to take sled's own lock, which a sled just closed in this process releases a
/// moment later.
const OPEN_ATTEMPTS: u32 = 50;
/// Sled's message for a full disk.
const NO_ROOM: &str = "No space left on device";
const OPEN_ATTEMPT_PAUSE: Duration = Duration::from_millis(20);

/// Result of the check against the last writes.
pub(super) struct Verified {
    /// The tally to continue with.
    pub(super) tally: Tally,
    pub(super) live_bytes: u64,
    /// The damage, if any.
    pub(super) damage: Option<OpenError>,
}

/// Checks the levels against tally and mark.
pub(super) fn verify(folder: &Path, levels: &Levels) -> Result<Verified, OpenError> {
    let unreadable = |error: EngineError| unreadable(folder, &error);
    let path = folder.join(mark::MARK_FILE);
    let found_mark =
        mark::read(folder).map_err(|source| OpenError::Io { path: path.clone(), source })?;
    let record = guarded("reading", || levels.get(&TALLY_KEY)).map_err(unreadable)?;
    let Contents { sum, n_pairs, live_bytes } = census::take(levels).map_err(unreadable)?;
    let tally = record.as_deref().map(Tally::from_record);
    let there = tally.flatten().map_or(0, |tally| tally.commits);
    let acknowledged = match found_mark {
        Found::Commits(commits) => commits,
        Found::Absent | Found::Damaged => 0,
    };
    let folder = folder.to_owned();
    let damage = match (found_mark, tally) {
        (Found::Commits(_), _) if acknowledged > there => {
            Some(OpenError::LostCommits { folder, acknowledged, found: there })
        }
        (_, Some(None)) => Some(OpenError::Altered { folder, found: n_pairs }),
        (_, Some(Some(tally))) if tally.sum != sum => {
            Some(OpenError::Altered { folder, found: n_pairs })
        }
        (Found::Damaged, _) => Some(OpenError::Mark { path, fault: "is damaged" }),
        (Found::Absent, Some(_)) => Some(OpenError::Mark { path, fault: "is missing" }),
        // New, or of layout 1, which had no tally.
        (Found::Absent | Found::Commits(_), None) => None,
        (Found::Commits(_), Some(_)) => None,
    };
    let tally = Tally { commits: there.max(acknowledged), sum };
    Ok(Verified { tally, live_bytes, damage })
}

/// The error of files that the engine cannot read.
pub(super) fn unreadable(folder: &Path, error: &EngineError) -> OpenError {
    OpenError::Damaged { folder: folder.to_owned(), detail: error.to_string() }
}

/// Bytes that each API key holds.
pub(super) fn held(levels: &Levels) -> Result<Held, EngineError> {
    let (held, prefix) = (Held::default(), key::space(Space::Holding));
    guarded("counting the bytes of keys", || {
        let pairs = levels.range(Bound::Included(&prefix));
        let within = |pair: &::sled::Result<Pair>| {
            pair.as_ref().map_or(true, |(key, _)| key.starts_with(&prefix))
        };
        pairs.take_while(within).collect::<::sled::Result<Vec<Pair>>>()
    })?
    .iter()
    .try_for_each(|(key, record)| held.note(key, None, Some(record)))?;
    Ok(held)
}

/// Opens the database's files.
pub(super) fn open_levels(
    folder: &Path,
    current: Current,
    options: &SledOptions,
) -> Result<Levels, OpenError> {
    let base = match current.base {
        Some(number) => {
            let path = base_file(folder, number);
            Some(Arc::new(Base::open(&path).map_err(|error| unusable(folder, &path, error))?))
        }
        None => None,
    };
    // Both read their logs; in parallel, a restart during a merge takes the time of one.
    let (top, frozen) = std::thread::scope(|scope| {
        let open = |number| open_layer(folder, number, options);
        let frozen = scope.spawn(move || current.frozen.map(open).transpose());
        (open(current.top), frozen.join())
    });
    let frozen = frozen.unwrap_or_else(|panic| std::panic::resume_unwind(panic))?;
    Ok(Levels { top: top?, frozen, base })
}

/// Opens the sled with the given number, created durably if it is missing.
pub(super) fn open_layer(
    folder: &Path,
    number: u64,
    options: &SledOptions,
) -> Result<Layer, OpenError> {
    let sled_folder = sled_folder(folder, number);
    let db = match open_sled(folder, &sled_folder, options) {
        Err(OpenError::Damaged { .. }) if set_derived_aside(folder, &sled_folder)? => {
            open_sled(folder, &sled_folder, options)?
        }
        other => other?,
    };
    for made in [sled_folder.as_path(), folder] {
        let synced = File::open(made).and_then(|made_folder| made_folder.sync_all());
        synced.map_err(|source| OpenError::Io { path: made.to_owned(), source })?;
    }
    Ok(Layer { db, folder: sled_folder, form: Form::of(number) })
}

/// Damage if the bytes are wrong, otherwise the operating system's error for the file.
pub(super) fn unusable(folder: &Path, path: &Path, source: io::Error) -> OpenError {
    match source.kind() {
        io::ErrorKind::InvalidData | io::ErrorKind::UnexpectedEof => {
            OpenError::Damaged { folder: folder.to_owned(), detail: source.to_string() }
        }
        _ => OpenError::Io { path: path.to_owned(), source },
    }
}

/// Locks the folder.
pub(super) fn lock_folder(folder: &Path) -> Result<File, OpenError> {
    let path = folder.join(LOCK_FILE);
    let opened = OpenOptions::new().create(true).truncate(false).write(true).open(&path);
    let lock = opened.map_err(|source| OpenError::Io { path: path.clone(), source })?;
    match FileExt::try_lock(&lock) {
        Ok(()) => Ok(lock),
        Err(fs4::TryLockError::WouldBlock) => {
            Err(OpenError::InUse { folder: folder.to_owned(), lock: path })
        }
        Err(fs4::TryLockError::Error(source)) => Err(OpenError::Io { path, source }),
    }
}

/// Moves sled's own snapshots aside, which it rebuilds from its log; whether there were any.
/// The rebuilt state is checked against tally and mark as always.
fn set_derived_aside(folder: &Path, sled_folder: &Path) -> Result<bool, OpenError> {
    let io = |path: &Path| {
        let path = path.to_owned();
        move |source| OpenError::Io { path, source }
    };
    let mut is_any = false;
    for entry in fs::read_dir(sled_folder).map_err(io(sled_folder))? {
        let path = entry.map_err(io(sled_folder))?.path();
        let name = path.file_name().unwrap_or_default().to_owned();
        if !name.to_string_lossy().starts_with("snap.") {
            continue;
        }
        let aside = folder.join(ASIDE_FOLDER);
        fs::create_dir_all(&aside).map_err(io(&aside))?;
        fs::rename(&path, aside.join(&name)).map_err(io(&path))?;
        tracing::error!("Set {} aside: the database does not open with it", path.display());
        is_any = true;
    }
    Ok(is_any)
}

/// Opens sled itself.
fn open_sled(
    folder: &Path,
    sled_folder: &Path,
    options: &SledOptions,
) -> Result<::sled::Db, OpenError> {
    // Only the writer flushes, since concurrent flushes deadlock in sled.
    let config = ::sled::Config::new()
        .path(sled_folder)
        .cache_capacity(options.cache_bytes)
        .flush_every_ms(None);
    let mut attempt = 1;
    loop {
        match guarded("opening", || config.open()) {
            Ok(db) => return Ok(db),
            Err(EngineError::Failed { detail, .. }) => {
                let still_locked = detail.contains("could not acquire lock");
                if detail.contains(NO_ROOM) {
                    return Err(OpenError::NoRoom { folder: folder.to_owned(), detail });
                }
                if !still_locked || attempt == OPEN_ATTEMPTS {
                    return Err(OpenError::Damaged { folder: folder.to_owned(), detail });
                }
            }
            Err(error) => {
                let detail = error.to_string();
                return Err(OpenError::Damaged { folder: folder.to_owned(), detail });
            }
        }
        std::thread::sleep(OPEN_ATTEMPT_PAUSE);
        attempt += 1;
    }
}
