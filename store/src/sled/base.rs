//! The base: an immutable file of sorted pairs, the result of a compaction.
//!
//! Blocks of pairs in ascending order of their keys, each with a CRC-32; then an index of the
//! blocks' first keys; then a footer with the sum over all pairs. `docs/formats.md` draws it. A
//! file is made durable before `current` names it and never changes afterwards, so readers share
//! it without a lock.

pub(super) mod writing;

use std::fs::File;
use std::io;
use std::ops::{Bound, Range};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use bytes::Buf;

use super::tally::Contents;
use crate::engine::{KEY_BYTES_MAX, Pair, VALUE_BYTES_MAX};

const MAGIC: [u8; 4] = *b"PLPB";
const VERSION: u32 = 2;
/// Length of the footer: magic, version u32, index at u64, index length u64, pairs u64, bytes of
/// pairs u64, sum u128, CRC-32 of the index, CRC-32 of these; little-endian.
const FOOTER_BYTES: usize = 64;
/// Length at which a block ends with the pair that reaches it. Chosen: a read of one key
/// costs one block, the index costs memory for each.
const BLOCK_BYTES: usize = 8 << 10;
/// Maximum length of a block: with the pair that ends it, and its checksum.
const BLOCK_BYTES_MAX: usize = BLOCK_BYTES + PAIR_HEAD_BYTES + KEY_BYTES_MAX + VALUE_BYTES_MAX + 4;
/// Length of a pair's head: length of the key u16, length of the value u16.
const PAIR_HEAD_BYTES: usize = 4;
const CHECKSUM_BYTES: usize = 4;
/// An open file of sorted pairs.
#[derive(Debug)]
pub(super) struct Base {
    file: File,
    path: PathBuf,
    blocks: Vec<Block>,
    /// Contents according to its footer.
    contents: Contents,
}

/// Position of a block, and its first key.
#[derive(Debug)]
struct Block {
    first: Box<[u8]>,
    at: u64,
    length: u32,
}

impl Base {
    /// Opens a finished file.
    pub(super) fn open(path: &Path) -> io::Result<Self> {
        let damaged = |what: &str| damage(path, what);
        let file = File::open(path)?;
        let length = file.metadata()?.len();
        let footer_at = length.checked_sub(FOOTER_BYTES as u64);
        let footer_at = footer_at.ok_or_else(|| damaged("is too short"))?;
        let mut footer = [0; FOOTER_BYTES];
        read_at(&file, &mut footer, footer_at)?;
        let (body, checksum) = footer.split_at(FOOTER_BYTES - CHECKSUM_BYTES);
        let head = [&MAGIC[..], &VERSION.to_le_bytes()].concat();
        if crc32fast::hash(body).to_le_bytes() != checksum || !body.starts_with(&head) {
            return Err(damaged("has no whole footer"));
        }
        let mut body = &body[head.len()..];
        let (index_at, index_length) = (body.get_u64_le(), body.get_u64_le());
        let (n_pairs, live_bytes, sum) = (body.get_u64_le(), body.get_u64_le(), body.get_u128_le());
        if index_at.checked_add(index_length) != Some(footer_at) {
            return Err(damaged("has an index that does not fit"));
        }
        let mut index = vec![0; usize::try_from(index_length).map_err(io::Error::other)?];
        read_at(&file, &mut index, index_at)?;
        if crc32fast::hash(&index) != body.get_u32_le() {
            return Err(damaged("has a damaged index"));
        }
        let blocks = blocks(&index).ok_or_else(|| damaged("has a damaged index"))?;
        let contents = Contents { sum, n_pairs, live_bytes };
        Ok(Self { file, path: path.to_owned(), blocks, contents })
    }

    /// The contents, as counted when it was written.
    pub(super) fn contents(&self) -> Contents {
        self.contents
    }

    /// Number of blocks.
    pub(super) fn n_blocks(&self) -> usize {
        self.blocks.len()
    }

    /// Checks the checksums of some of its blocks, which lie one behind the other.
    pub(super) fn check(&self, places: Range<usize>) -> io::Result<()> {
        let blocks = self.blocks.get(places).unwrap_or_default();
        let (Some(first), Some(last)) = (blocks.first(), blocks.last()) else { return Ok(()) };
        let mut bytes = vec![0; (last.at - first.at) as usize + last.length as usize];
        read_at(&self.file, &mut bytes, first.at)?;
        for block in blocks {
            let from = (block.at - first.at) as usize;
            let whole = bytes.get(from..from + block.length as usize).unwrap_or_default();
            split_block(whole).ok_or_else(|| self.damaged_at(block.at))?;
        }
        Ok(())
    }

    /// The value of `key`.
    pub(super) fn get(&self, key: &[u8]) -> io::Result<Option<Vec<u8>>> {
        let after = self.blocks.partition_point(|block| *block.first <= *key);
        let Some(place) = after.checked_sub(1) else { return Ok(None) };
        let pairs = self.read(place)?;
        let found = pairs.into_iter().find(|(found, _)| found.as_slice() >= key);
        Ok(found.filter(|(found, _)| found == key).map(|(_, value)| value))
    }

    /// The pairs from `start` on, in ascending order.
    pub(super) fn range(self: &Arc<Self>, start: Bound<&[u8]>) -> BaseRange {
        let first = match start {
            Bound::Included(key) | Bound::Excluded(key) => key,
            Bound::Unbounded => &[],
        };
        let after = self.blocks.partition_point(|block| *block.first <= *first);
        BaseRange {
            base: Arc::clone(self),
            place: after.saturating_sub(1),
            pairs: Vec::new().into_iter(),
            start: start.map(<[u8]>::to_vec),
        }
    }

    /// The pairs of a block.
    fn read(&self, place: usize) -> io::Result<Vec<Pair>> {
        let block = &self.blocks[place];
        let mut bytes = vec![0; block.length as usize];
        read_at(&self.file, &mut bytes, block.at)?;
        let damaged = || self.damaged_at(block.at);
        let mut rest = split_block(&bytes).ok_or_else(damaged)?;
        let mut pairs = Vec::with_capacity(32);
        while !rest.is_empty() {
            pairs.push(split_pair(&mut rest).ok_or_else(damaged)?);
        }
        Ok(pairs)
    }

    fn damaged_at(&self, at: u64) -> io::Error {
        damage(&self.path, &format!("has a damaged block at {at}"))
    }
}

/// Looks keys up that ascend: a block is read once for all of its keys.
pub(super) struct BaseCursor<'base> {
    base: &'base Base,
    /// The block that was read last.
    place: Option<usize>,
    pairs: Vec<Pair>,
}

impl<'base> BaseCursor<'base> {
    pub(super) fn new(base: &'base Base) -> Self {
        Self { base, place: None, pairs: Vec::new() }
    }

    /// The value of `key`.
    pub(super) fn get(&mut self, key: &[u8]) -> io::Result<Option<&[u8]>> {
        let after = self.base.blocks.partition_point(|block| *block.first <= *key);
        let Some(place) = after.checked_sub(1) else { return Ok(None) };
        if self.place != Some(place) {
            self.pairs = self.base.read(place)?;
            self.place = Some(place);
        }
        let found = self.pairs.binary_search_by(|(found, _)| found.as_slice().cmp(key));
        Ok(found.ok().map(|at| self.pairs[at].1.as_slice()))
    }
}

/// The pairs of a base from a key on.
pub(super) struct BaseRange {
    base: Arc<Base>,
    /// Index of the next block.
    place: usize,
    pairs: std::vec::IntoIter<Pair>,
    start: Bound<Vec<u8>>,
}

impl Iterator for BaseRange {
    type Item = io::Result<Pair>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            for pair in self.pairs.by_ref() {
                let is_within = match &self.start {
                    Bound::Included(start) => pair.0 >= *start,
                    Bound::Excluded(start) => pair.0 > *start,
                    Bound::Unbounded => true,
                };
                if is_within {
                    self.start = Bound::Unbounded;
                    return Some(Ok(pair));
                }
            }
            if self.place == self.base.blocks.len() {
                return None;
            }
            match self.base.read(self.place) {
                Ok(pairs) => self.pairs = pairs.into_iter(),
                Err(error) => return Some(Err(error)),
            }
            self.place += 1;
        }
    }
}

fn blocks(mut index: &[u8]) -> Option<Vec<Block>> {
    let mut blocks = Vec::new();
    while !index.is_empty() {
        let first_length = index.try_get_u16_le().ok()?;
        let first = index.split_off(..usize::from(first_length))?.into();
        let (at, length) = (index.try_get_u64_le().ok()?, index.try_get_u32_le().ok()?);
        if !(CHECKSUM_BYTES..=BLOCK_BYTES_MAX).contains(&(length as usize)) {
            return None;
        }
        blocks.push(Block { first, at, length });
    }
    Some(blocks)
}

/// The content of a block with a valid checksum.
fn split_block(bytes: &[u8]) -> Option<&[u8]> {
    let (pairs, checksum) = bytes.split_last_chunk::<CHECKSUM_BYTES>()?;
    (crc32fast::hash(pairs).to_le_bytes() == *checksum).then_some(pairs)
}

fn split_pair(bytes: &mut &[u8]) -> Option<Pair> {
    let (key, value) = (bytes.try_get_u16_le().ok()?, bytes.try_get_u16_le().ok()?);
    let [key, value] = [key, value].map(|length| bytes.split_off(..usize::from(length)));
    Some((key?.to_vec(), value?.to_vec()))
}

fn damage(path: &Path, what: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, format!("{} {what}", path.display()))
}

#[cfg(unix)]
fn read_at(file: &File, bytes: &mut [u8], at: u64) -> io::Result<()> {
    std::os::unix::fs::FileExt::read_exact_at(file, bytes, at)
}

#[cfg(windows)]
fn read_at(file: &File, mut bytes: &mut [u8], mut at: u64) -> io::Result<()> {
    while !bytes.is_empty() {
        let n_read = std::os::windows::fs::FileExt::seek_read(file, bytes, at)?;
        if n_read == 0 {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        bytes = &mut bytes[n_read..];
        at += n_read as u64;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::writing::BaseWriter;
    use super::*;

    fn pairs(n: u32) -> Vec<Pair> {
        let value = |i: u32| vec![i as u8; (i as usize * 37) % (VALUE_BYTES_MAX + 1)];
        (0..n).map(|i| (format!("key {i:06}").into_bytes(), value(i))).collect()
    }

    fn written(path: &Path, pairs: &[Pair]) -> Arc<Base> {
        let mut writer = BaseWriter::create(path).unwrap();
        pairs.iter().for_each(|(key, value)| writer.put(key, value).unwrap());
        Arc::new(writer.finish().unwrap())
    }

    #[test]
    fn a_base_returns_its_pairs() {
        let folder = tempfile::tempdir().unwrap();
        for n in [0, 1, 500] {
            let pairs = pairs(n);
            let base = written(&folder.path().join("base"), &pairs);
            let all: io::Result<Vec<Pair>> = base.range(Bound::Unbounded).collect();
            assert_eq!(all.unwrap(), pairs);
            for (place, (key, value)) in pairs.iter().enumerate() {
                assert_eq!(base.get(key).unwrap().as_ref(), Some(value));
                let behind = base.range(Bound::Excluded(key)).next().transpose().unwrap();
                assert_eq!(behind.as_ref(), pairs.get(place + 1));
                let from = base.range(Bound::Included(key)).next().transpose().unwrap();
                assert_eq!(from.as_ref(), pairs.get(place));
                let between = [key.as_slice(), b"!"].concat();
                assert_eq!(base.get(&between).unwrap(), None);
            }
            assert_eq!(base.get(b"a").unwrap(), None);
        }
    }

    #[test]
    fn a_footer_has_the_sum_of_all_pairs() {
        let folder = tempfile::tempdir().unwrap();
        let pairs = pairs(300);
        let base = written(&folder.path().join("base"), &pairs);
        let mut contents = Contents::default();
        pairs.iter().for_each(|(key, value)| contents.add(key, value));
        assert_eq!(base.contents(), contents);
        let mut cursor = BaseCursor::new(&base);
        for (key, value) in &pairs {
            assert_eq!(cursor.get(key).unwrap(), Some(value.as_slice()));
            assert_eq!(cursor.get(&[key.as_slice(), b"!"].concat()).unwrap(), None);
        }
        assert_eq!(cursor.get(b"a").unwrap(), None);
    }

    #[test]
    fn flipped_bits_and_truncation_of_a_base_are_detected() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("base");
        written(&path, &pairs(40));
        let whole = std::fs::read(&path).unwrap();
        let read = || -> io::Result<Vec<Pair>> {
            Arc::new(Base::open(&path)?).range(Bound::Unbounded).collect()
        };
        for place in (0..whole.len()).step_by(53).chain(whole.len() - 200..whole.len()) {
            let mut flipped = whole.clone();
            flipped[place] ^= 4;
            std::fs::write(&path, flipped).unwrap();
            assert!(read().is_err(), "byte {place}");
            let checked = Base::open(&path).and_then(|base| base.check(0..base.n_blocks()));
            assert!(checked.is_err(), "byte {place}");
        }
        for length in [0, 10, whole.len() / 2, whole.len() - 1] {
            std::fs::write(&path, &whole[..length]).unwrap();
            assert!(read().is_err(), "{length} bytes");
        }
    }
}
