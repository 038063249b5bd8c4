//! Writing of a snapshot in chunks, so that it is never held in memory.

use std::collections::{BTreeMap, VecDeque};

use super::{END, FORM, MADE_BY_BYTES_MAX, MAGIC, PAIR, SnapshotHeader};
use crate::engine::{Cut, EngineError, Pair};

/// Number of pairs per read: at most 1 MB.
const PAIRS_PER_READ: usize = 256;

/// Writes a cut as a snapshot.
pub struct SnapshotWriter {
    cut: Box<dyn Cut>,
    hasher: blake3::Hasher,
    pairs: BTreeMap<u8, u64>,
    bytes: u64,
    waiting: VecDeque<u8>,
    is_at_end: bool,
}

impl SnapshotWriter {
    /// Starts a snapshot of `cut`.
    #[must_use]
    pub fn new(cut: Box<dyn Cut>, header: &SnapshotHeader) -> Self {
        let made_by = &header.made_by.as_bytes()[..header.made_by.len().min(MADE_BY_BYTES_MAX)];
        let mut head = MAGIC.to_vec();
        head.extend_from_slice(&FORM.to_le_bytes());
        head.extend_from_slice(&header.layout.to_le_bytes());
        head.extend_from_slice(&header.created_at_ms.to_le_bytes());
        head.extend_from_slice(&(made_by.len() as u16).to_le_bytes());
        head.extend_from_slice(made_by);
        let (pairs, bytes, hasher) = (BTreeMap::new(), 0, blake3::Hasher::new());
        Self { cut, hasher, pairs, bytes, waiting: head.into(), is_at_end: false }
    }

    /// The next bytes; `None` after the last.
    ///
    /// # Errors
    /// The engine's: the bytes so far are then not a snapshot.
    pub fn next_chunk(&mut self) -> Result<Option<Vec<u8>>, EngineError> {
        if self.is_at_end {
            return Ok(None);
        }
        let mut chunk: Vec<u8> = std::mem::take(&mut self.waiting).into();
        let page = self.cut.next(PAIRS_PER_READ)?;
        self.is_at_end = page.is_empty();
        for pair in &page {
            self.write_pair(pair, &mut chunk);
        }
        if self.is_at_end {
            self.write_end(&mut chunk);
        }
        self.hasher.update(&chunk);
        if self.is_at_end {
            chunk.extend_from_slice(self.hasher.finalize().as_bytes());
        }
        Ok(Some(chunk))
    }

    fn write_pair(&mut self, (key, value): &Pair, chunk: &mut Vec<u8>) {
        chunk.push(PAIR);
        // The engine bounds keys to 256 bytes and values to 4096.
        chunk.extend_from_slice(&(key.len() as u16).to_le_bytes());
        chunk.extend_from_slice(&(value.len() as u16).to_le_bytes());
        chunk.extend_from_slice(key);
        chunk.extend_from_slice(value);
        *self.pairs.entry(key[0]).or_default() += 1;
        self.bytes += (key.len() + value.len()) as u64;
    }

    fn write_end(&self, chunk: &mut Vec<u8>) {
        chunk.push(END);
        chunk.extend_from_slice(&(self.pairs.len() as u16).to_le_bytes());
        for (letter, n_pairs) in &self.pairs {
            chunk.push(*letter);
            chunk.extend_from_slice(&n_pairs.to_le_bytes());
        }
        chunk.extend_from_slice(&self.bytes.to_le_bytes());
    }
}
