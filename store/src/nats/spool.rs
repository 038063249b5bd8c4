//! The spool: values that this process has followed, in temporary files. Large content stays in
//! its objects until it is read.
//!
//! It makes reads local without keeping all values in memory. Its files have no name and vanish
//! with the process; a start fills them anew from the stream. A file is freed when no key and no
//! cut uses it any more.

use std::fs::File;
use std::io;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::cache::unnamed_file;
use super::content::Object;
use super::pairs::Place;
use crate::engine::EngineError;
use crate::private;

/// Bytes after which a new file begins.
const SEGMENT_BYTES: u32 = 64 << 20;
/// Longest value that is kept in memory.
const IN_MEMORY_BYTES_MAX: usize = 128;

/// Where a value is.
#[derive(Clone, Debug)]
pub(super) enum Stored {
    Memory(Arc<[u8]>),
    File { file: Arc<File>, at: u32, length: u16 },
    Content { object: Arc<Object>, at: u32, length: u16 },
}

impl Stored {
    pub(super) fn len(&self) -> usize {
        match self {
            Self::Memory(bytes) => bytes.len(),
            Self::File { length, .. } | Self::Content { length, .. } => usize::from(*length),
        }
    }

    /// The value. Blocks while content is fetched.
    pub(super) fn read(&self) -> Result<Vec<u8>, EngineError> {
        match self {
            Self::Memory(bytes) => Ok(bytes.to_vec()),
            Self::File { file, at, length } => {
                let mut bytes = vec![0; usize::from(*length)];
                let read = file.read_exact_at(&mut bytes, u64::from(*at));
                let doing = "reading the spool";
                read.map_err(|error| EngineError::Failed { doing, detail: error.to_string() })?;
                Ok(bytes)
            }
            Self::Content { object, at, length } => object.read(*at, *length),
        }
    }
}

impl Place for Stored {
    fn part(&self) -> Option<(usize, u32, u16)> {
        match self {
            Self::Content { object, at, length } => {
                Some((Arc::as_ptr(object) as usize, *at, *length))
            }
            Self::Memory(_) | Self::File { .. } => None,
        }
    }

    fn beside(&self, at: u32, length: u16) -> Self {
        match self {
            Self::Content { object, .. } => {
                Self::Content { object: Arc::clone(object), at, length }
            }
            // Neither is a part.
            Self::Memory(_) | Self::File { .. } => self.clone(),
        }
    }
}

/// The file that takes new values.
#[derive(Debug)]
pub(super) struct Spool {
    folder: PathBuf,
    file: Option<Arc<File>>,
    end: u32,
}

impl Spool {
    /// A spool with files in `folder`.
    pub(super) fn new(folder: &Path) -> io::Result<Self> {
        private::create_folder(folder)?;
        Ok(Self { folder: folder.to_owned(), file: None, end: 0 })
    }

    /// Keeps values, in their order.
    pub(super) fn store(&mut self, values: &[&[u8]]) -> io::Result<Vec<Stored>> {
        let mut stored = Vec::with_capacity(values.len());
        let mut pending = Vec::new();
        for value in values {
            let length = match u16::try_from(value.len()) {
                Ok(length) if value.len() > IN_MEMORY_BYTES_MAX => length,
                _ => {
                    stored.push(Stored::Memory((*value).into()));
                    continue;
                }
            };
            if self.end >= SEGMENT_BYTES {
                self.write(&mut pending)?;
                self.file = None;
            }
            let file = self.current()?;
            stored.push(Stored::File { file, at: self.end, length });
            self.end += u32::from(length);
            pending.extend_from_slice(value);
        }
        self.write(&mut pending)?;
        Ok(stored)
    }

    /// Writes bytes so that they end at the spool's end.
    fn write(&mut self, pending: &mut Vec<u8>) -> io::Result<()> {
        if let Some(file) = &self.file {
            file.write_all_at(pending, u64::from(self.end) - pending.len() as u64)?;
        }
        pending.clear();
        Ok(())
    }

    fn current(&mut self) -> io::Result<Arc<File>> {
        if let Some(file) = &self.file {
            return Ok(Arc::clone(file));
        }
        let file = Arc::new(unnamed_file(&self.folder)?);
        self.end = 0;
        self.file = Some(Arc::clone(&file));
        Ok(file)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_read_back_over_several_files() {
        let folder = std::env::temp_dir().join(format!("palpate-spool-{}", uuid::Uuid::now_v7()));
        let mut spool = Spool::new(&folder).expect("the folder can be made");
        let mut kept = Vec::new();
        for number in 0..20u8 {
            spool.end = spool.end.max(if number == 9 { SEGMENT_BYTES - 300 } else { 0 });
            let values = [vec![number; 200], vec![number; 100], vec![number; 4096], Vec::new()];
            let slices: Vec<&[u8]> = values.iter().map(Vec::as_slice).collect();
            kept.push((values.clone(), spool.store(&slices).expect("the disk has room")));
        }
        for (values, stored) in &kept {
            for (value, stored) in values.iter().zip(stored) {
                assert_eq!(stored.len(), value.len());
                assert_eq!(&stored.read().expect("it was written"), value);
            }
        }
        let left = std::fs::read_dir(&folder).expect("the folder exists").count();
        assert_eq!(left, 0, "no file has a name");
        std::fs::remove_dir(&folder).expect("it is empty");
    }
}
