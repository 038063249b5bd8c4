//! The file that the first administrator's key is written to, which only its owner may read.
//!
//! It is made before the server starts, so that no key is made that could not be written down.

use std::fs::{self, File};
use std::io::Write as _;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use palpate_store::private;

/// A file that a key may be written to; without one, what is there stays.
pub(crate) struct AdminKeyFile {
    path: PathBuf,
    part: PathBuf,
    file: Option<File>,
}

impl AdminKeyFile {
    /// Makes the file beside, which gets its name with the key.
    pub(crate) fn prepare(path: &Path) -> anyhow::Result<Self> {
        let mut name = path.file_name().context("expected the name of a file")?.to_owned();
        name.push(".part");
        let part = path.with_file_name(name);
        let file = private::create(&part)
            .with_context(|| format!("cannot write the admin's key to {}", path.display()))?;
        Ok(Self { path: path.to_owned(), part, file: Some(file) })
    }

    /// Writes the key; gives the file's name.
    pub(crate) fn write(mut self, key: &str) -> anyhow::Result<PathBuf> {
        let mut write = || {
            if let Some(mut file) = self.file.take() {
                writeln!(file, "{key}")?;
                file.sync_all()?;
            }
            fs::rename(&self.part, &self.path)
        };
        write().with_context(|| {
            format!(
                "cannot write the admin's key to {}: start again with --new-admin-key",
                self.path.display()
            )
        })?;
        Ok(self.path.clone())
    }
}

impl Drop for AdminKeyFile {
    fn drop(&mut self) {
        // Already gone when the key was written.
        let _ = fs::remove_file(&self.part);
    }
}
