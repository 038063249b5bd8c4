//! Records larger than one value: the first piece under the key, further pieces after it.
//!
//! The envelope in the first piece states the whole length; piece *n* lies under the key
//! followed by *n* (u32, big-endian), so it sorts after the first and before the next key.
//! The envelope's checksum covers all pieces. Small records are written in one commit. Large
//! immutable ones ([`write_large`]) are written in many, the first piece last: a record with
//! a first piece is complete.

use std::ops::Range;

use crate::engine::{Commit, CommitError, Engine, EngineError, Pair, VALUE_BYTES_MAX};
use crate::envelope;
use crate::error::{RecordError, StoreError};
use crate::key::{self, Space};

/// Number of pieces in one commit of [`write_large`].
const PIECES_PER_COMMIT: usize = 256;
/// Number of pieces per read.
const PIECES_PER_SCAN: usize = 1024;
/// Attempts to read a record that is being replaced.
const READ_ATTEMPTS: usize = 16;

/// Number of pieces of a record of `bytes`.
fn n_pieces(bytes: usize) -> u32 {
    u32::try_from(bytes.div_ceil(VALUE_BYTES_MAX)).unwrap_or(u32::MAX)
}

/// Adds to `commit` the writes of a record, and the removal of the surplus pieces of a longer one.
pub(crate) fn put(commit: Commit, head: &[u8], record: &[u8], replaced: Option<&[u8]>) -> Commit {
    let mut commit = commit;
    for (piece, bytes) in (0u32..).zip(record.chunks(VALUE_BYTES_MAX)) {
        let key = if piece == 0 { head.to_vec() } else { key::piece(head, piece) };
        commit = commit.put(key, bytes.to_vec());
    }
    let before = replaced.map_or(0, |bytes| n_pieces(bytes.len()));
    (n_pieces(record.len())..before)
        .fold(commit, |commit, piece| commit.remove(key::piece(head, piece)))
}

/// Adds to `commit` the removal of a record.
pub(crate) fn remove(commit: Commit, head: &[u8], record: &[u8]) -> Commit {
    let commit = commit.remove(head.to_vec());
    (1..n_pieces(record.len())).fold(commit, |commit, piece| commit.remove(key::piece(head, piece)))
}

/// The first piece of a record, which represents the whole in an expectation: it holds the
/// checksum.
pub(crate) fn first(record: &[u8]) -> Vec<u8> {
    record[..record.len().min(VALUE_BYTES_MAX)].to_vec()
}

/// Reads a record with all its pieces; its envelope is unchecked.
pub(crate) fn read(
    engine: &dyn Engine,
    space: Space,
    head: &[u8],
) -> Result<Option<Vec<u8>>, StoreError> {
    let Some(mut first) = engine.get(head)? else { return Ok(None) };
    for _ in 0..READ_ATTEMPTS {
        let whole = complete(engine, space, head, &first);
        if whole.as_ref().is_ok_and(|whole| whole.len() == first.len()) {
            return whole.map(Some);
        }
        match engine.get(head)? {
            Some(now) if now == first => return whole.map(Some),
            Some(now) => first = now,
            None => return Ok(None),
        }
    }
    Err(StoreError::Damaged { space, source: RecordError::Piece { piece: 0 } })
}

/// Limit of a scan of records.
#[derive(Clone, Copy, Debug)]
pub struct Limit {
    /// Maximum number of records.
    pub records: usize,
    /// The scan ends with the record that reaches this many bytes, so it reads at least one.
    pub bytes: usize,
}

impl Limit {
    /// At most this many records of any size.
    pub(crate) fn records(records: usize) -> Self {
        Self { records, bytes: usize::MAX }
    }
}

/// Up to `limit` records whose keys have `prefix`, are `head_bytes` long and greater than
/// `after`: keys and complete records, in ascending order.
pub(crate) fn scan(
    engine: &dyn Engine,
    space: Space,
    prefix: &[u8],
    head_bytes: usize,
    after: Option<Vec<u8>>,
    limit: Limit,
) -> Result<Vec<Pair>, StoreError> {
    let mut found = Vec::new();
    let mut after = after;
    let (mut records, mut bytes) = (0, 0usize);
    while records < limit.records && bytes < limit.bytes {
        let page = engine.scan(
            prefix,
            after.as_deref(),
            (limit.records - records).clamp(16, PIECES_PER_SCAN),
        )?;
        let Some((last, _)) = page.last() else { break };
        after = Some(last.clone());
        for (head, value) in page {
            if records == limit.records || bytes >= limit.bytes {
                break;
            }
            if head.len() != head_bytes {
                continue;
            }
            let fits = envelope::total_bytes(&value).is_ok_and(|total| total == value.len());
            let record = if fits { Some(value) } else { read(engine, space, &head)? };
            // A missing record was removed in the meantime.
            let Some(record) = record else { continue };
            (records, bytes) = (records + 1, bytes.saturating_add(record.len()));
            found.push((head, record));
        }
    }
    Ok(found)
}

/// Writes a large immutable record, its first piece in the last commit.
pub(crate) async fn write_large(
    engine: &dyn Engine,
    head: &[u8],
    record: &[u8],
) -> Result<(), EngineError> {
    let (first, rest) = record.split_at(record.len().min(VALUE_BYTES_MAX));
    let rest = (1u32..).zip(rest.chunks(VALUE_BYTES_MAX));
    let rest = rest.map(|(piece, bytes)| (key::piece(head, piece), bytes));
    let pieces: Vec<_> = rest.chain([(head.to_vec(), first)]).collect();
    for group in pieces.chunks(PIECES_PER_COMMIT) {
        let commit = group
            .iter()
            .fold(Commit::new(), |commit, (key, bytes)| commit.put(key.clone(), bytes.to_vec()));
        commit_unconditionally(engine, commit).await?;
    }
    Ok(())
}

/// Removes every key with `prefix`.
pub(crate) async fn remove_all(engine: &dyn Engine, prefix: &[u8]) -> Result<(), EngineError> {
    loop {
        let page = engine.keys(prefix, None, PIECES_PER_COMMIT)?;
        if page.is_empty() {
            return Ok(());
        }
        let commit = page.into_iter().fold(Commit::new(), Commit::remove);
        commit_unconditionally(engine, commit).await?;
    }
}

async fn commit_unconditionally(engine: &dyn Engine, commit: Commit) -> Result<(), EngineError> {
    match engine.commit(commit).await {
        Ok(()) => Ok(()),
        Err(CommitError::Engine(error)) => Err(error),
        Err(CommitError::Conflict { .. }) => unreachable!("the commit expects nothing"),
    }
}

/// The complete record that begins with the piece `first`.
fn complete(
    engine: &dyn Engine,
    space: Space,
    head: &[u8],
    first: &[u8],
) -> Result<Vec<u8>, StoreError> {
    let mut rest = Rest::behind(space, head, first)?;
    let mut whole = first.to_vec();
    loop {
        let bytes = rest.next(engine, PIECES_PER_SCAN)?;
        if bytes.is_empty() {
            return Ok(whole);
        }
        whole.extend_from_slice(&bytes);
    }
}

/// Position of a reader in a record, after its first piece.
#[derive(Debug)]
pub(crate) struct Rest {
    space: Space,
    head: Vec<u8>,
    after: Vec<u8>,
    wanted: Range<u32>,
}

impl Rest {
    /// Starts after the piece `first` of the record under `head`.
    pub(crate) fn behind(space: Space, head: &[u8], first: &[u8]) -> Result<Self, StoreError> {
        let total = envelope::total_bytes(first);
        let total = total.map_err(|error| StoreError::damaged(space)(error.into()))?;
        let (head, after) = (head.to_vec(), head.to_vec());
        Ok(Self { space, head, after, wanted: 1..n_pieces(total) })
    }

    /// The bytes of at most `limit` more pieces; none at the end.
    pub(crate) fn next(
        &mut self,
        engine: &dyn Engine,
        limit: usize,
    ) -> Result<Vec<u8>, StoreError> {
        let damaged = StoreError::damaged(self.space);
        if self.wanted.is_empty() {
            return Ok(Vec::new());
        }
        let page = engine.scan(&self.head, Some(&self.after), self.wanted.len().min(limit))?;
        if page.is_empty() {
            return Err(damaged(RecordError::Piece { piece: self.wanted.start }));
        }
        let mut whole = Vec::with_capacity(page.len() * VALUE_BYTES_MAX);
        for ((key, bytes), piece) in page.into_iter().zip(&mut self.wanted) {
            if key != key::piece(&self.head, piece) {
                return Err(damaged(RecordError::Piece { piece }));
            }
            whole.extend_from_slice(&bytes);
            self.after = key;
        }
        Ok(whole)
    }
}
