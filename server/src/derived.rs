//! Files of derived data, one per id, in a folder. A file may be missing, old or torn: its reader
//! detects this and derives the data again.

use std::fs;
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};

use uuid::Uuid;

/// A folder of derived files.
#[derive(Debug)]
pub(crate) struct DerivedFiles {
    folder: PathBuf,
    /// What a file is, in messages.
    what: &'static str,
    /// Maximum length of a file, bytes.
    bytes_max: u64,
}

impl DerivedFiles {
    /// Files in a folder that is created with the first one.
    pub(crate) fn new(folder: PathBuf, what: &'static str, bytes_max: u64) -> Self {
        Self { folder, what, bytes_max }
    }

    /// Replaces a file. Blocks.
    pub(crate) fn keep(&self, id: Uuid, bytes: &[u8]) {
        let (path, part) = (self.path(id), self.path(id).with_extension("part"));
        // Not flushed: a torn file is found out, and only costs time.
        let kept = fs::create_dir_all(&self.folder)
            .and_then(|()| fs::write(&part, bytes))
            .and_then(|()| fs::rename(&part, &path));
        if let Err(error) = kept {
            tracing::warn!("Cannot keep {} in {}: {error}", self.what, path.display());
        }
    }

    /// A file's content; `None` without one. Blocks.
    pub(crate) fn find(&self, id: Uuid) -> Option<Vec<u8>> {
        let mut bytes = Vec::new();
        let file = fs::File::open(self.path(id)).ok()?;
        file.take(self.bytes_max).read_to_end(&mut bytes).ok()?;
        Some(bytes)
    }

    /// Removes a file. Blocks.
    pub(crate) fn remove(&self, id: Uuid) {
        remove(&self.path(id));
    }

    /// Removes every file that is not of an id that stays. Blocks.
    pub(crate) fn tidy(&self, stays: impl Fn(Uuid) -> bool) {
        let Ok(files) = fs::read_dir(&self.folder) else { return };
        for file in files.flatten() {
            let path = file.path();
            let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
            if !Uuid::try_parse(name).is_ok_and(&stays) {
                remove(&path);
            }
        }
    }

    fn path(&self, id: Uuid) -> PathBuf {
        self.folder.join(id.simple().to_string())
    }
}

fn remove(path: &Path) {
    if let Err(error) = fs::remove_file(path)
        && error.kind() != ErrorKind::NotFound
    {
        tracing::warn!("Cannot remove {}: {error}", path.display());
    }
}
