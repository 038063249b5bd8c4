//! File of recorded readings: the wire's readings under a small header, specified in
//! `docs/formats.md`.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use palpate_client::schemas::Reading;
use serde::{Deserialize, Serialize};

use crate::json_file::read_json;

/// Format name in the file.
const FORMAT: &str = "palpate-readings";
/// Version of the format.
const VERSION: u32 = 1;

/// Recorded readings and how they were taken.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ReadingsFile {
    format: String,
    version: u32,
    /// Name of the true object, if known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) object: Option<String>,
    /// Seed of the simulation, if it was one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) seed: Option<u64>,
    /// The readings, in the order in which they were taken.
    pub(crate) readings: Vec<Reading>,
}

impl ReadingsFile {
    /// Creates a recording.
    pub(crate) fn new(object: Option<String>, seed: Option<u64>, readings: Vec<Reading>) -> Self {
        Self { format: FORMAT.to_owned(), version: VERSION, object, seed, readings }
    }

    /// Reads a file; `-` reads standard input.
    pub(crate) fn read(path: &Path) -> anyhow::Result<Self> {
        let file: Self = read_json(PathBuf::from(path))?;
        anyhow::ensure!(
            file.format == FORMAT && file.version == VERSION,
            "{} is {} version {}, expected {FORMAT} version {VERSION}",
            path.display(),
            file.format,
            file.version
        );
        anyhow::ensure!(!file.readings.is_empty(), "{} holds no readings", path.display());
        Ok(file)
    }

    /// Writes the file.
    pub(crate) fn write(&self, path: &Path) -> anyhow::Result<()> {
        let text = serde_json::to_string(self)?;
        std::fs::write(path, text + "\n")
            .with_context(|| format!("cannot write {}", path.display()))
    }
}

#[cfg(test)]
mod tests {
    use palpate_client::schemas::Pose;

    use super::*;

    fn reading() -> Reading {
        Reading {
            robot: Some("explorer-7".to_owned()),
            seq: Some(3),
            sensor: "digitacts-6x6".to_owned(),
            frame_id: None,
            stamp: None,
            pose: Some(Pose { position: [0.1, 0.2, 0.3], orientation: [0.0, 0.0, 0.0, 1.0] }),
            image: vec![Some(1.0 / 3.0), None],
            feature: None,
            approach_m: None,
            object_moved: None,
            contact: None,
            shear: None,
        }
    }

    #[test]
    fn what_is_written_is_read_back_exactly() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("readings.json");
        let file = ReadingsFile::new(Some("mug".to_owned()), Some(7), vec![reading()]);
        file.write(&path).unwrap();
        assert_eq!(ReadingsFile::read(&path).unwrap(), file);
    }

    #[test]
    fn other_files_are_refused_with_what_they_are() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("readings.json");
        let refused = |file: &ReadingsFile| {
            file.write(&path).unwrap();
            ReadingsFile::read(&path).unwrap_err().to_string()
        };
        let file = ReadingsFile::new(None, None, vec![reading()]);
        let newer = refused(&ReadingsFile { version: 2, ..file.clone() });
        assert!(newer.contains("version 2") && newer.contains("expected"), "{newer}");
        let empty = refused(&ReadingsFile { readings: Vec::new(), ..file });
        assert!(empty.contains("no readings"), "{empty}");
    }
}
