//! Reading of a snapshot: every byte is checked, and nothing is trusted before the end.

use std::collections::BTreeMap;
use std::io::{ErrorKind, Read};

use super::{
    END, FORM, MADE_BY_BYTES_MAX, MAGIC, PAIR, SnapshotError, SnapshotHeader, SnapshotManifest,
};
use crate::access::AccessKey;
use crate::database::LAYOUT;
use crate::engine::{
    self, Commit, CommitError, Engine, EngineError, KEY_BYTES_MAX, Pair, VALUE_BYTES_MAX,
};
use crate::fsck::{Checker, Report};
use crate::key::{self, ID_KEY_BYTES, Space};
use crate::record;

/// Number of pairs in one commit of a restoration.
const PAIRS_PER_COMMIT: usize = 256;

/// Reads a snapshot pair by pair.
struct Reader<R> {
    source: R,
    at: u64,
    hasher: blake3::Hasher,
    header: SnapshotHeader,
    last: Vec<u8>,
    pairs: BTreeMap<u8, u64>,
    bytes: u64,
}

/// Reads a snapshot to its end; returns its content and the check of its records.
///
/// # Errors
/// [`SnapshotError`] names the fault of the stream; damage of single records is in the report.
pub fn verify(source: impl Read) -> Result<(SnapshotManifest, Report), SnapshotError> {
    let mut reader = Reader::new(source)?;
    let mut checker = Checker::default();
    loop {
        match reader.next()? {
            Some((key, value)) => checker.pair(&key, &value),
            None => return Ok((reader.finish()?, checker.finish())),
        }
    }
}

/// The API keys in a verified snapshot, oldest first, without damaged ones.
///
/// # Errors
/// [`SnapshotError`] names the fault of the stream.
pub fn keys(source: impl Read) -> Result<Vec<AccessKey>, SnapshotError> {
    let (mut reader, mut found) = (Reader::new(source)?, Vec::new());
    while let Some((key, value)) = reader.next()? {
        if key.first() == Some(&(Space::AccessKey as u8)) && key.len() == ID_KEY_BYTES {
            found.extend(record::decode::<AccessKey>(&value).ok());
        }
    }
    reader.finish()?;
    Ok(found)
}

/// Source of a restored database's API keys, with the names of robots that they own, and of its
/// webhooks.
#[derive(Clone, Copy)]
pub enum KeysFrom<'engine> {
    /// The snapshot.
    Snapshot,
    /// None: the database has no keys.
    Nowhere,
    /// This database, with its latest time.
    Engine(&'engine dyn Engine),
}

impl KeysFrom<'_> {
    /// Whether a pair of the snapshot is restored.
    fn takes(self, key: &[u8]) -> bool {
        let is_of = |spaces: &[Space]| spaces.iter().any(|space| key[0] == *space as u8);
        match self {
            Self::Snapshot => true,
            Self::Nowhere => !is_of(&OF_KEYS),
            Self::Engine(_) => !is_of(&OF_KEYS) && !is_of(&[Space::Clock]),
        }
    }
}

/// Spaces of keys and dependent records, and of webhooks: a copy without the keys must not send
/// what the original sends.
const OF_KEYS: [Space; 5] =
    [Space::AccessKey, Space::RobotHolder, Space::Webhook, Space::Delivery, Space::Notice];

/// Copies keys and dependent records from another database.
fn copy_keys(from: &dyn Engine, engine: &dyn Engine) -> Result<(), EngineError> {
    for space in OF_KEYS.into_iter().chain([Space::Clock]) {
        for page in engine::pages(from, &key::space(space), None, PAIRS_PER_COMMIT) {
            let put = |commit: Commit, (key, value)| commit.put(key, value);
            write(engine, page?.into_iter().fold(Commit::new(), put))?;
        }
    }
    Ok(())
}

/// Restores a snapshot into an empty engine, the layout's number last: a database without it
/// is refused, so an interrupted restoration is never taken for a complete one. Blocks.
///
/// # Errors
/// [`SnapshotError`]; the engine may then hold a part, without a layout.
pub fn restore(
    source: impl Read,
    engine: &dyn Engine,
    from: KeysFrom<'_>,
) -> Result<SnapshotManifest, SnapshotError> {
    if !engine.scan(&[], None, 1)?.is_empty() {
        return Err(SnapshotError::NotEmpty);
    }
    let mut reader = Reader::new(source)?;
    let layout_key = key::space(Space::Layout);
    let (mut layout, mut commit) = (None, Commit::new());
    while let Some((key, value)) = reader.next()? {
        if key == layout_key {
            layout = Some(value);
            continue;
        }
        if !from.takes(&key) {
            continue;
        }
        commit = commit.put(key, value);
        if commit.writes.len() == PAIRS_PER_COMMIT {
            write(engine, std::mem::take(&mut commit))?;
        }
    }
    let at = reader.at;
    let manifest = reader.finish()?;
    write(engine, commit)?;
    if let KeysFrom::Engine(other) = from {
        copy_keys(other, engine)?;
    }
    let fault = "it has no layout";
    let layout = layout.ok_or(SnapshotError::Damaged { at, fault })?;
    write(engine, Commit::new().put(layout_key, layout))?;
    Ok(manifest)
}

fn write(engine: &dyn Engine, commit: Commit) -> Result<(), EngineError> {
    if commit.writes.is_empty() {
        return Ok(());
    }
    engine.commit(commit).wait().map_err(|error| match error {
        CommitError::Engine(error) => error,
        CommitError::Conflict { .. } => unreachable!("the commit expects nothing"),
    })
}

impl<R: Read> Reader<R> {
    fn new(source: R) -> Result<Self, SnapshotError> {
        let header = SnapshotHeader { layout: 0, created_at_ms: 0, made_by: String::new() };
        let (hasher, pairs) = (blake3::Hasher::new(), BTreeMap::new());
        let mut reader = Self { source, at: 0, hasher, header, last: Vec::new(), pairs, bytes: 0 };
        if reader.array::<8>()? != MAGIC {
            return Err(SnapshotError::Magic);
        }
        let form = u32::from_le_bytes(reader.array()?);
        if form != FORM {
            return Err(SnapshotError::Form { found: form });
        }
        reader.header.layout = u32::from_le_bytes(reader.array()?);
        reader.header.created_at_ms = u64::from_le_bytes(reader.array()?);
        let length = usize::from(u16::from_le_bytes(reader.array()?));
        if length > MADE_BY_BYTES_MAX {
            return Err(reader.damaged("the name of who made it is too long"));
        }
        let made_by = reader.vector(length)?;
        let made_by = String::from_utf8(made_by);
        reader.header.made_by =
            made_by.map_err(|_| reader.damaged("the name of who made it is no text"))?;
        if reader.header.layout > LAYOUT {
            let found = reader.header.layout;
            return Err(SnapshotError::TooNew { found, known: LAYOUT });
        }
        Ok(reader)
    }

    /// The next pair; `None` at the end.
    fn next(&mut self) -> Result<Option<Pair>, SnapshotError> {
        match self.array::<1>()? {
            [PAIR] => {}
            [END] => return Ok(None),
            _ => return Err(self.damaged("neither a pair nor the end begins here")),
        }
        let key_length = usize::from(u16::from_le_bytes(self.array()?));
        let value_length = usize::from(u16::from_le_bytes(self.array()?));
        if key_length == 0 || key_length > KEY_BYTES_MAX || value_length > VALUE_BYTES_MAX {
            return Err(self.damaged("a key or value has a length that none has"));
        }
        let key = self.vector(key_length)?;
        let value = self.vector(value_length)?;
        if key[0] == 0 || key <= self.last {
            return Err(self.damaged("keys do not ascend"));
        }
        self.last.clone_from(&key);
        *self.pairs.entry(key[0]).or_default() += 1;
        self.bytes += (key_length + value_length) as u64;
        Ok(Some((key, value)))
    }

    /// Reads the part after the last pair.
    fn finish(mut self) -> Result<SnapshotManifest, SnapshotError> {
        let n_spaces = u16::from_le_bytes(self.array()?);
        if usize::from(n_spaces) != self.pairs.len() {
            return Err(self.damaged("the counts of its end are not those of its pairs"));
        }
        let mut counted = BTreeMap::new();
        for _ in 0..n_spaces {
            let [letter] = self.array()?;
            counted.insert(letter, u64::from_le_bytes(self.array()?));
        }
        let bytes = u64::from_le_bytes(self.array()?);
        if counted != self.pairs || bytes != self.bytes {
            return Err(self.damaged("the counts of its end are not those of its pairs"));
        }
        let found = *self.hasher.finalize().as_bytes();
        let hash = self.array::<32>()?;
        if hash != found {
            return Err(self.damaged("its hash is not that of its bytes"));
        }
        match self.source.read(&mut [0]) {
            Ok(0) => {}
            Ok(_) => return Err(self.damaged("something follows its end")),
            Err(error) => return Err(SnapshotError::Io(error)),
        }
        Ok(SnapshotManifest { header: self.header, pairs: self.pairs, bytes: self.bytes, hash })
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], SnapshotError> {
        let mut bytes = [0; N];
        self.fill(&mut bytes)?;
        Ok(bytes)
    }

    fn vector(&mut self, length: usize) -> Result<Vec<u8>, SnapshotError> {
        let mut bytes = vec![0; length];
        self.fill(&mut bytes)?;
        Ok(bytes)
    }

    fn fill(&mut self, bytes: &mut [u8]) -> Result<(), SnapshotError> {
        self.source.read_exact(bytes).map_err(|error| match error.kind() {
            ErrorKind::UnexpectedEof => SnapshotError::CutOff { at: self.at },
            _ => SnapshotError::Io(error),
        })?;
        self.at += bytes.len() as u64;
        self.hasher.update(bytes);
        Ok(())
    }

    fn damaged(&self, fault: &'static str) -> SnapshotError {
        SnapshotError::Damaged { at: self.at, fault }
    }
}
