//! Files and folders that only their owner may read.
//!
//! On systems without such modes they are created as usual. Those of another user stay
//! unchanged, with an entry in the log.

use std::fs::{self, File, OpenOptions};
use std::io;
use std::path::Path;

/// Creates or truncates a file that only its owner may read and write.
///
/// # Errors
/// The system's.
pub fn create(path: &Path) -> io::Result<File> {
    create_with(OpenOptions::new().truncate(true), path)
}

/// Opens a file for writing, created if missing; only its owner may read and write it.
pub(crate) fn open(path: &Path) -> io::Result<File> {
    create_with(OpenOptions::new().truncate(false), path)
}

fn create_with(options: &mut OpenOptions, path: &Path) -> io::Result<File> {
    options.write(true).create(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(options, 0o600);
    let file = options.open(path)?;
    // An existing file has kept its mode.
    tighten_one(path)?;
    Ok(file)
}

/// Creates a folder and missing parents; only its owner may enter it.
///
/// # Errors
/// The system's.
pub fn create_folder(path: &Path) -> io::Result<()> {
    let mut builder = fs::DirBuilder::new();
    builder.recursive(true);
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
    builder.create(path)
}

/// Removes the rights of everyone but the owner from a folder and everything in it. Links are
/// not followed.
pub(crate) fn tighten(folder: &Path) {
    if let Err(error) = tighten_one(folder) {
        tracing::warn!("Cannot keep other users out of {}: {error}", folder.display());
        return;
    }
    let Ok(entries) = fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        match entry.file_type() {
            Ok(kind) if kind.is_dir() => tighten(&entry.path()),
            Ok(kind) if kind.is_file() => {
                // The folder above keeps others out in any case.
                let _ = tighten_one(&entry.path());
            }
            Ok(_) | Err(_) => {}
        }
    }
}

/// Removes the rights of everyone but the owner from a file or folder.
#[cfg(unix)]
fn tighten_one(path: &Path) -> io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    let metadata = fs::metadata(path)?;
    let mode = metadata.permissions().mode();
    if mode & 0o077 == 0 {
        return Ok(());
    }
    fs::set_permissions(path, fs::Permissions::from_mode(mode & 0o700))
}

#[cfg(not(unix))]
fn tighten_one(_path: &Path) -> io::Result<()> {
    Ok(())
}
