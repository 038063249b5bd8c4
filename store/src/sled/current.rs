//! The file `current`, which names the database's files and is replaced atomically.
//!
//! A folder without `current` was never compacted: it is `sled` alone. Files that are not
//! named are remains of an interrupted compaction, and are removed once the database has
//! proved to be complete.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// The file in the database's folder.
const CURRENT_FILE: &str = "current";
const PART_FILE: &str = "current.part";
const MAGIC: [u8; 4] = *b"PLPC";
const VERSION: u32 = 1;
/// Length of the file: magic, version u32, top u64, frozen u64, base u64, CRC-32 of these;
/// little-endian.
const BYTES: usize = 36;
/// The number for no file.
const NONE: u64 = u64::MAX;
/// Prefix of the names of sled folders; number 0 has no more.
const SLED: &str = "sled";
const BASE: &str = "base";

/// The numbers of the database's files.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Current {
    /// The sled that is written to.
    pub(super) top: u64,
    /// The sled under it, during a compaction.
    pub(super) frozen: Option<u64>,
    /// The base under all.
    pub(super) base: Option<u64>,
}

impl Current {
    /// Reads the folder's file.
    pub(super) fn read(folder: &Path) -> io::Result<Self> {
        let bytes = match fs::read(folder.join(CURRENT_FILE)) {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                return Self::never_compacted(folder);
            }
            Err(error) => return Err(error),
        };
        let current = Self::from_bytes(&bytes).ok_or_else(|| damage("is damaged"))?;
        let files = current.files(folder);
        match files.iter().find(|path| !path.exists()) {
            Some(missing) => Err(damage(&format!("names {}, which is missing", missing.display()))),
            None => Ok(current),
        }
    }

    fn never_compacted(folder: &Path) -> io::Result<Self> {
        let current = Self::default();
        let is_there = sled_folder(folder, current.top).exists();
        if !is_there && !current.unnamed(folder)?.is_empty() {
            return Err(damage("is missing"));
        }
        Ok(current)
    }

    /// Writes the folder's file durably.
    pub(super) fn write(self, folder: &Path) -> io::Result<()> {
        let part = folder.join(PART_FILE);
        let mut file = File::create(&part)?;
        file.write_all(&self.to_bytes())?;
        file.sync_all()?;
        fs::rename(&part, folder.join(CURRENT_FILE))?;
        File::open(folder)?.sync_all()
    }

    fn to_bytes(self) -> Vec<u8> {
        let mut bytes = [&MAGIC[..], &VERSION.to_le_bytes()].concat();
        for number in [self.top, self.frozen.unwrap_or(NONE), self.base.unwrap_or(NONE)] {
            bytes.extend_from_slice(&number.to_le_bytes());
        }
        bytes.extend_from_slice(&crc32fast::hash(&bytes).to_le_bytes());
        bytes
    }

    fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let (body, checksum) = bytes.split_at_checked(BYTES - 4)?;
        let head = [&MAGIC[..], &VERSION.to_le_bytes()].concat();
        let is_whole = crc32fast::hash(body).to_le_bytes() == checksum && body.starts_with(&head);
        let number = |at: usize| body[at..at + 8].try_into().map_or(NONE, u64::from_le_bytes);
        let some = |number: u64| (number != NONE).then_some(number);
        is_whole.then(|| Self { top: number(8), frozen: some(number(16)), base: some(number(24)) })
    }

    /// A number that no file has.
    pub(super) fn next(self) -> u64 {
        let others = [self.frozen, self.base].into_iter().flatten();
        others.chain([self.top]).max().unwrap_or(0) + 1
    }

    /// The database's files and folders.
    pub(super) fn files(self, folder: &Path) -> Vec<PathBuf> {
        let sleds = [Some(self.top), self.frozen].into_iter().flatten();
        let sleds = sleds.map(|number| sled_folder(folder, number));
        sleds.chain(self.base.map(|number| base_file(folder, number))).collect()
    }

    /// Files and folders of compactions that do not belong to the database.
    pub(super) fn unnamed(self, folder: &Path) -> io::Result<Vec<PathBuf>> {
        let own = self.files(folder);
        Ok(all(folder)?.into_iter().filter(|path| !own.contains(path)).collect())
    }
}

/// The folder of a sled.
pub(super) fn sled_folder(folder: &Path, number: u64) -> PathBuf {
    match number {
        0 => folder.join(SLED),
        _ => folder.join(format!("{SLED}-{number}")),
    }
}

/// The file of a base.
pub(super) fn base_file(folder: &Path, number: u64) -> PathBuf {
    folder.join(format!("{BASE}-{number}"))
}

/// All sleds and bases in the folder, named or not.
fn all(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let name = entry.file_name().to_string_lossy().into_owned();
        let is_numbered = |word: &str| {
            let number = name.strip_prefix(word).and_then(|rest| rest.strip_prefix('-'));
            number.is_some_and(|number| number.parse::<u64>().is_ok())
        };
        if name == SLED || is_numbered(SLED) || is_numbered(BASE) {
            found.push(entry.path());
        }
    }
    Ok(found)
}

/// Bytes of all sleds and bases in the folder, including remains.
pub(super) fn stored_bytes(folder: &Path) -> io::Result<u64> {
    all(folder)?.iter().map(|path| bytes_of(path)).sum()
}

/// Bytes of a file, or of all files of a folder; 0 for one just removed.
pub(super) fn bytes_of(path: &Path) -> io::Result<u64> {
    let gone = |error: io::Error| match error.kind() {
        io::ErrorKind::NotFound => Ok(0),
        _ => Err(error),
    };
    let metadata = match fs::metadata(path) {
        Ok(metadata) => metadata,
        Err(error) => return gone(error),
    };
    if !metadata.is_dir() {
        return Ok(metadata.len());
    }
    match fs::read_dir(path) {
        Ok(mut entries) => entries.try_fold(0, |sum, entry| Ok(sum + bytes_of(&entry?.path())?)),
        Err(error) => gone(error),
    }
}

/// Removes a file or a folder of a compaction.
pub(super) fn remove(path: &Path) -> io::Result<()> {
    let removed = match path.is_dir() {
        true => fs::remove_dir_all(path),
        false => fs::remove_file(path),
    };
    removed.or_else(|error| match error.kind() {
        io::ErrorKind::NotFound => Ok(()),
        _ => Err(error),
    })
}

fn damage(what: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, format!("the file `{CURRENT_FILE}` {what}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn current_reads_back_and_a_flipped_bit_is_detected() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        assert_eq!(Current::read(folder).unwrap(), Current::default());
        for current in [
            Current { top: 3, frozen: None, base: Some(2) },
            Current { top: 4, frozen: Some(3), base: None },
        ] {
            for path in current.files(folder) {
                fs::create_dir_all(path).unwrap();
            }
            current.write(folder).unwrap();
            assert_eq!(Current::read(folder).unwrap(), current);
            assert_eq!(current.next(), current.top + 1);
            let bytes = current.to_bytes();
            for bit in 0..bytes.len() * 8 {
                let mut flipped = bytes.clone();
                flipped[bit / 8] ^= 1 << (bit % 8);
                assert_eq!(Current::from_bytes(&flipped), None, "bit {bit}");
            }
        }
        fs::remove_dir_all(folder.join("sled-4")).unwrap();
        assert!(Current::read(folder).unwrap_err().to_string().contains("sled-4"));
        fs::remove_file(folder.join(CURRENT_FILE)).unwrap();
        assert!(Current::read(folder).unwrap_err().to_string().contains("is missing"));
    }
}
