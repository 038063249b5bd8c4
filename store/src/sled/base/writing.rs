//! Writing of a base: pairs in ascending order, then the index and the footer.
//!
//! The file is durable when [`BaseWriter::finish`] returns.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use super::{BLOCK_BYTES, BLOCK_BYTES_MAX, Base, Block, MAGIC, VERSION};
use crate::sled::tally::Contents;

/// Number of bytes between syncs: one sync of everything would delay the log's. Chosen.
const SYNC_BYTES: u64 = 4 << 20;

/// Writer of a file of sorted pairs.
#[derive(Debug)]
pub(in crate::sled) struct BaseWriter {
    file: BufWriter<File>,
    path: PathBuf,
    blocks: Vec<Block>,
    /// The block that is not full yet.
    block: Vec<u8>,
    first: Vec<u8>,
    at: u64,
    synced_at: u64,
    contents: Contents,
}

impl BaseWriter {
    /// Creates a file, replacing one of that name.
    pub(in crate::sled) fn create(path: &Path) -> io::Result<Self> {
        Ok(Self {
            file: BufWriter::with_capacity(1 << 20, File::create(path)?),
            path: path.to_owned(),
            blocks: Vec::new(),
            block: Vec::with_capacity(BLOCK_BYTES_MAX),
            first: Vec::new(),
            at: 0,
            synced_at: 0,
            contents: Contents::default(),
        })
    }

    /// Appends a pair, whose key must be greater than all before.
    pub(in crate::sled) fn put(&mut self, key: &[u8], value: &[u8]) -> io::Result<()> {
        let too_long = |_| io::Error::other("a key or a value is too long for a base");
        if self.block.is_empty() {
            self.first = key.to_vec();
        }
        let lengths = [key.len(), value.len()].map(u16::try_from);
        for length in lengths {
            self.block.extend_from_slice(&length.map_err(too_long)?.to_le_bytes());
        }
        self.block.extend_from_slice(key);
        self.block.extend_from_slice(value);
        self.contents.add(key, value);
        if self.block.len() >= BLOCK_BYTES { self.end_block() } else { Ok(()) }
    }

    /// The pairs written so far.
    pub(in crate::sled) fn contents(&self) -> Contents {
        self.contents
    }

    fn end_block(&mut self) -> io::Result<()> {
        let checksum = crc32fast::hash(&self.block);
        self.block.extend_from_slice(&checksum.to_le_bytes());
        self.file.write_all(&self.block)?;
        let length = self.block.len() as u32;
        let first = std::mem::take(&mut self.first).into_boxed_slice();
        self.blocks.push(Block { first, at: self.at, length });
        self.at += u64::from(length);
        self.block.clear();
        if self.at - self.synced_at >= SYNC_BYTES {
            self.file.flush()?;
            self.file.get_ref().sync_data()?;
            self.synced_at = self.at;
        }
        Ok(())
    }

    /// Writes index and footer, makes the file durable and opens it.
    pub(in crate::sled) fn finish(mut self) -> io::Result<Base> {
        if !self.block.is_empty() {
            self.end_block()?;
        }
        let mut index = Vec::new();
        for block in &self.blocks {
            index.extend_from_slice(&(block.first.len() as u16).to_le_bytes());
            index.extend_from_slice(&block.first);
            index.extend_from_slice(&block.at.to_le_bytes());
            index.extend_from_slice(&block.length.to_le_bytes());
        }
        let mut footer = [&MAGIC[..], &VERSION.to_le_bytes()].concat();
        footer.extend_from_slice(&self.at.to_le_bytes());
        footer.extend_from_slice(&(index.len() as u64).to_le_bytes());
        footer.extend_from_slice(&self.contents.n_pairs.to_le_bytes());
        footer.extend_from_slice(&self.contents.live_bytes.to_le_bytes());
        footer.extend_from_slice(&self.contents.sum.to_le_bytes());
        footer.extend_from_slice(&crc32fast::hash(&index).to_le_bytes());
        footer.extend_from_slice(&crc32fast::hash(&footer).to_le_bytes());
        self.file.write_all(&index)?;
        self.file.write_all(&footer)?;
        self.file.flush()?;
        self.file.get_ref().sync_all()?;
        Base::open(&self.path)
    }
}
