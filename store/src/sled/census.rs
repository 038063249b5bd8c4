//! The census of an opening: the content of all levels, found by reading each byte once.
//!
//! The footer of a base states its totals, so that only the checksums of its blocks are
//! verified. The sleds on top are read pair by pair, and their changes to the base are added.
//! Both are divided into parts that threads take one by one; a sled does not reveal the
//! distribution of its keys, so it is divided evenly between the first and the last key of each
//! space, whose ids ascend with time. The time is linear in the bytes; a byte of a sled takes
//! about ten times as long as one of the base.

use std::ops::{Bound, Range};
use std::sync::{Mutex, PoisonError};

use super::base::{Base, BaseCursor};
use super::guarded;
use super::levels::{Layer, Levels};
use super::tally::{Contents, TALLY_KEY};
use crate::engine::EngineError;

/// Maximum number of reading threads.
const THREADS_MAX: usize = 8;
/// Number of parts into which the keys of one space are cut, in each sled. Chosen: parts of
/// equal time have different sizes in bytes, and idle threads take another.
const PARTS: u64 = 32;
/// Blocks of a base that are checked at once, about a megabyte.
const BLOCKS: usize = 128;

/// A part of the work.
enum Part {
    /// The keys of the sleds between two cuts.
    Sleds(Vec<u8>, Option<Vec<u8>>),
    /// Some blocks of the base.
    Blocks(Range<usize>),
}

/// Reads all levels.
pub(super) fn take(levels: &Levels) -> Result<Contents, EngineError> {
    let base = levels.base.as_deref();
    let parts = Mutex::new(parts(levels)?);
    let work = || {
        let mut found = Contents::default();
        loop {
            let next = parts.lock().unwrap_or_else(PoisonError::into_inner).pop();
            match next {
                Some(part) => found = found.plus(guarded("checking", || read(levels, &part))?),
                None => return Ok(found),
            }
        }
    };
    let n_threads = std::thread::available_parallelism().map_or(1, usize::from).min(THREADS_MAX);
    std::thread::scope(|scope| {
        let threads: Vec<_> = (0..n_threads).map(|_| scope.spawn(work)).collect();
        let whole = base.map_or_else(Contents::default, Base::contents);
        threads.into_iter().try_fold(whole, |all, thread| {
            let panicked = |_| EngineError::Failed {
                doing: "checking",
                detail: "a thread panicked".to_owned(),
            };
            Ok(all.plus(thread.join().map_err(panicked)??))
        })
    })
}

/// The changes that a part of the sleds makes to the base; for its blocks only the check.
fn read(levels: &Levels, part: &Part) -> ::sled::Result<Contents> {
    let base = levels.base.as_deref();
    let mut found = Contents::default();
    let (start, end) = match part {
        Part::Blocks(places) => {
            base.map_or(Ok(()), |base| base.check(places.clone()))?;
            return Ok(found);
        }
        Part::Sleds(start, end) => (start, end),
    };
    let mut below = base.map(BaseCursor::new);
    for entry in levels.changes(Bound::Included(start)) {
        let (key, value) = entry?;
        if end.as_ref().is_some_and(|end| key >= *end) {
            break;
        }
        if let Some(below) = &mut below
            && let Some(before) = below.get(&key)?
        {
            found.remove(&key, before);
        }
        if let Some(value) = value {
            found.add(&key, &value);
        }
    }
    Ok(found)
}

/// All parts; the sleds', which take longest, come last and are taken first.
fn parts(levels: &Levels) -> Result<Vec<Part>, EngineError> {
    let n_blocks = levels.base.as_ref().map_or(0, |base| base.n_blocks());
    let blocks = (0..n_blocks).step_by(BLOCKS).map(|from| from..(from + BLOCKS).min(n_blocks));
    let mut parts: Vec<Part> = blocks.map(Part::Blocks).collect();
    let mut cuts = vec![[&TALLY_KEY[..], &[0]].concat()];
    for layer in std::iter::once(&levels.top).chain(&levels.frozen) {
        cuts.extend(guarded("checking", || layer_cuts(layer))?);
    }
    cuts.sort();
    cuts.dedup();
    let ends = cuts.iter().skip(1).cloned().map(Some).chain(std::iter::once(None));
    let sleds: Vec<Part> = cuts.iter().cloned().zip(ends).map(|(a, b)| Part::Sleds(a, b)).collect();
    parts.extend(sleds);
    Ok(parts)
}

/// Keys that cut a sled: evenly between the first and the last key of each space.
fn layer_cuts(layer: &Layer) -> ::sled::Result<Vec<Vec<u8>>> {
    let mut cuts = Vec::new();
    let mut from = vec![TALLY_KEY[0] + 1];
    loop {
        let Some((first, _)) = layer.db.range(from.clone()..).next().transpose()? else { break };
        let letter = first[0];
        let Some(next) = letter.checked_add(1) else { break };
        let last = layer.db.range(from..vec![next]).next_back().transpose()?;
        let last = last.map_or_else(|| first.to_vec(), |(last, _)| last.to_vec());
        let (low, high) = (place(&first), place(&last));
        let step = (high - low) / PARTS;
        let between = (0..PARTS).map(|part| low + part * step);
        cuts.extend(between.map(|place| [&[letter][..], &place.to_be_bytes()].concat()));
        from = vec![next];
    }
    Ok(cuts)
}

/// Position of a key in its space: the eight bytes after its letter.
fn place(key: &[u8]) -> u64 {
    let mut bytes = [0; 8];
    let found = key.get(1..).unwrap_or_default();
    let length = found.len().min(8);
    bytes[..length].copy_from_slice(&found[..length]);
    u64::from_be_bytes(bytes)
}
