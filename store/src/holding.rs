//! Holdings: bytes that each API key wrote, by removable thing.
//!
//! An engine updates them with every commit that names an account: the bytes of the commit's
//! records minus those of the replaced ones are added to one record per thing and key. A count
//! is therefore as durable as the counted records. Removing a thing removes its holdings. The
//! sums for each key are kept in memory, and read again at every opening, in time linear in the
//! number of things. Not here: the choice of the account and of the quota (the server).

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use uuid::Uuid;

use crate::engine::{self, Account, Commit, Engine, EngineError, Pair};
use crate::envelope::{self, Kind};
use crate::key::{self, Space};
use crate::pieces;

/// The schema of a holding's record.
const SCHEMA: u16 = 1;
/// Number of records per read.
const RECORDS_PER_SCAN: usize = 1024;
const COUNTING: &str = "counting the bytes of a key";

/// Kind of a stored thing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ThingKind {
    /// A session with its readings.
    Session,
    /// An object with its mesh and its training readings.
    Object,
    /// A sensor with its calibrations.
    Sensor,
    /// A catalogue with its versions. Versions that share a block count it each.
    Catalogue,
    /// A training job.
    Job,
    /// The name of a robot; it has no id.
    Robot,
}

/// Bytes of a thing that a key wrote.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Holding {
    /// Kind of the thing.
    pub kind: ThingKind,
    /// Id of the thing; nil for a robot's name.
    pub id: Uuid,
    /// The key; nil for writes without a key.
    pub key: Uuid,
    /// Number of bytes.
    pub bytes: u64,
}

impl Holding {
    fn from_pair((key, value): &Pair) -> Result<Self, EngineError> {
        let damaged = || failed("a record's key has no form that a holding's has".to_owned());
        let (head, account) = key.split_last_chunk::<16>().ok_or_else(damaged)?;
        let kind = match head.get(1) {
            Some(b'e') => ThingKind::Session,
            Some(b'o' | b't' | b'f') => ThingKind::Object,
            Some(b's') => ThingKind::Sensor,
            Some(b'c' | b'v') => ThingKind::Catalogue,
            Some(b'j') => ThingKind::Job,
            Some(b'h') => ThingKind::Robot,
            _ => return Err(damaged()),
        };
        let id = match kind {
            ThingKind::Robot => Uuid::nil(),
            _ => head.get(2..18).and_then(|id| Uuid::from_slice(id).ok()).ok_or_else(damaged)?,
        };
        Ok(Self { kind, id, key: Uuid::from_bytes(*account), bytes: bytes(value)? })
    }
}

/// Key of the thing to which the record under `key` belongs; `None` for records with other
/// bounds, and for those that versions share.
///
/// Things whose keys share a prefix are removed together, such as uploads of an object's mesh.
pub(crate) fn thing(key: &[u8]) -> Option<Vec<u8>> {
    let (letter, rest) = key.split_first()?;
    let (space, length) = match letter {
        b'e' | b'R' | b'r' | b'w' | b'x' => (Space::Session, 16),
        b'o' | b'm' => (Space::Object, 16),
        b't' | b'T' | b'u' => (Space::Training, 16),
        b'f' => (Space::MeshFile, 32),
        b's' | b'k' => (Space::Sensor, 16),
        b'c' => (Space::Catalogue, 16),
        b'v' => (Space::Version, 24),
        b'j' => (Space::Job, 16),
        b'h' => return Some(robot(rest)),
        _ => return None,
    };
    Some([&[space as u8], rest.get(..length)?].concat())
}

/// Key of a robot's name as a thing. It contains the name's length, so that no key is a prefix
/// of another.
pub(crate) fn robot(name: &[u8]) -> Vec<u8> {
    let length = u8::try_from(name.len()).unwrap_or(u8::MAX);
    [&[Space::RobotHolder as u8, length], name].concat()
}

/// The prefix of the holdings of a thing, or of all things whose keys have this prefix.
fn prefix(thing: &[u8]) -> Vec<u8> {
    [&[Space::Holding as u8], thing].concat()
}

/// The key of what an API key holds of a thing.
pub(crate) fn key(thing: &[u8], account: Uuid) -> Vec<u8> {
    [&prefix(thing)[..], account.as_bytes()].concat()
}

/// Removes the holdings of a removed thing, and of all whose keys have its key as a prefix.
pub(crate) async fn release(engine: &dyn Engine, thing: &[u8]) -> Result<(), EngineError> {
    pieces::remove_all(engine, &prefix(thing)).await
}

/// The API key that wrote the thing's first record, if it was counted; nil for a write without a
/// key.
pub(crate) fn writer_of(engine: &dyn Engine, thing: &[u8]) -> Result<Option<Uuid>, EngineError> {
    let found = engine.scan(&prefix(thing), None, 1)?;
    Ok(found.first().map(Holding::from_pair).transpose()?.map(|holding| holding.key))
}

/// Calls `look` with all holdings, in the order of their keys.
pub(crate) fn each(engine: &dyn Engine, mut look: impl FnMut(Holding)) -> Result<(), EngineError> {
    for page in engine::pages(engine, &key::space(Space::Holding), None, RECORDS_PER_SCAN) {
        for pair in &page? {
            look(Holding::from_pair(pair)?);
        }
    }
    Ok(())
}

/// The number of bytes in a holding's record.
pub(crate) fn bytes(record: &[u8]) -> Result<u64, EngineError> {
    let opened =
        envelope::open(Kind::Holding, record).map_err(|error| failed(error.to_string()))?;
    let number = opened.payload.try_into().ok().filter(|_| opened.schema == SCHEMA);
    let unknown = || failed("a record has a schema that this version does not know".to_owned());
    number.map(u64::from_le_bytes).ok_or_else(unknown)
}

fn failed(detail: String) -> EngineError {
    EngineError::Failed { doing: COUNTING, detail }
}

/// Bytes that each key holds, updated by the writer of an engine.
#[derive(Debug, Default)]
pub(crate) struct Held(Mutex<BTreeMap<Uuid, u64>>);

impl Held {
    fn lock(&self) -> MutexGuard<'_, BTreeMap<Uuid, u64>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// All keys that hold something.
    pub(crate) fn all(&self) -> BTreeMap<Uuid, u64> {
        self.lock().clone()
    }

    /// Counts a change of a record, if it is a holding's.
    pub(crate) fn note(
        &self,
        key: &[u8],
        before: Option<&[u8]>,
        after: Option<&[u8]>,
    ) -> Result<(), EngineError> {
        if key.first() != Some(&(Space::Holding as u8)) {
            return Ok(());
        }
        let Some((_, account)) = key.split_last_chunk::<16>() else { return Ok(()) };
        let count = |record: Option<&[u8]>| record.map_or(Ok(0), bytes);
        let (before, after) = (count(before)?, count(after)?);
        let mut held = self.lock();
        let account = Uuid::from_bytes(*account);
        let now = held.get(&account).copied().unwrap_or(0).saturating_sub(before) + after;
        match now {
            0 => held.remove(&account),
            now => held.insert(account, now),
        };
        Ok(())
    }
}

/// Changes of the holdings of a commit's account.
pub(crate) struct Bill {
    account: Account,
    is_essential: bool,
    /// By the key of the thing.
    things: BTreeMap<Vec<u8>, i64>,
}

impl Bill {
    /// The bill of a commit that names an account.
    pub(crate) fn of(commit: &Commit) -> Option<Self> {
        let account = commit.account?;
        let counted = commit.counted.iter().map(|(thing, bytes)| (thing.clone(), *bytes as i64));
        Some(Self { account, is_essential: commit.is_essential, things: counted.collect() })
    }

    /// Adds a write: lengths of the value that it replaces, and of the new one. Removed records
    /// count until their thing is removed ([`release`]), since another key may have written
    /// them.
    pub(crate) fn add(&mut self, key: &[u8], before: Option<usize>, after: Option<usize>) {
        let Some((after, thing)) = after.zip(thing(key)) else { return };
        let size = |length: usize| (key.len() + length) as i64;
        *self.things.entry(thing).or_default() += size(after) - before.map_or(0, size);
    }

    /// The holdings as they are after the commit, unless it would exceed the quota.
    pub(crate) fn settle(
        self,
        held: &Held,
        get: impl Fn(&[u8]) -> Result<Option<Vec<u8>>, EngineError>,
    ) -> Result<Vec<Pair>, EngineError> {
        let more: i64 = self.things.values().sum();
        if !self.is_essential {
            held.check(self.account, u64::try_from(more).unwrap_or(0))?;
        }
        let mut records = Vec::with_capacity(self.things.len());
        for (thing, more) in self.things.into_iter().filter(|(_, more)| *more != 0) {
            let key = key(&thing, self.account.key);
            let before = get(&key)?.as_deref().map_or(Ok(0), bytes)?;
            let after = before.saturating_add_signed(more);
            records.push((key, envelope::seal(Kind::Holding, SCHEMA, &after.to_le_bytes())));
        }
        Ok(records)
    }
}

impl Held {
    /// Bytes that each key holds, as an engine states them.
    pub(crate) fn of(engine: &dyn Engine) -> Self {
        Self(Mutex::new(engine.held()))
    }

    /// Whether an account may write this many bytes more.
    pub(crate) fn check(&self, account: Account, more: u64) -> Result<(), EngineError> {
        let held = self.lock().get(&account.key).copied().unwrap_or(0);
        match account.quota {
            Some(quota) if more > 0 && held.saturating_add(more) > quota => {
                Err(EngineError::OverQuota { held, more, quota })
            }
            _ => Ok(()),
        }
    }
}

/// Function that returns the account of a commit when the commit is made; `None` for no account.
pub type Who = Arc<dyn Fn() -> Option<Account> + Send + Sync>;
