//! The first admin key: a file with the key that an operator has chosen, or a file for the key that
//! the server creates, readable only by its owner.
//!
//! The latter is created before the server starts, so that no key is made that cannot be written down.

use std::fs::{self, File};
use std::io::Write as _;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use palpate_server::ChosenKey;
use palpate_store::private;

/// Reads a key that the operator has chosen.
pub(crate) fn chosen(file: &Path) -> anyhow::Result<ChosenKey> {
    let shown = file.display();
    let text = fs::read_to_string(file)
        .with_context(|| format!("cannot read the first admin key in {shown}"))?;
    text.parse().with_context(|| format!("{shown} holds no key for the first admin"))
}

/// A file for a new key. Without a new key, an existing file stays unchanged.
pub(crate) struct AdminKeyFile {
    path: PathBuf,
    part: PathBuf,
    file: Option<File>,
}

impl AdminKeyFile {
    /// Creates a temporary file, which is renamed when the key is written.
    pub(crate) fn prepare(path: &Path) -> anyhow::Result<Self> {
        let mut name = path.file_name().context("expected the name of a file")?.to_owned();
        name.push(".part");
        let part = path.with_file_name(name);
        let file = private::create(&part)
            .with_context(|| format!("cannot write the admin's key to {}", path.display()))?;
        Ok(Self { path: path.to_owned(), part, file: Some(file) })
    }

    /// Writes the key. Returns the file's name.
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
