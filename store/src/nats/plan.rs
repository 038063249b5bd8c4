//! The plan of a commit: its conditions, checked against the index, and the messages that
//! publish it if nobody is faster.
//!
//! Each unit that a commit reads or writes gets a message that expects the unit's last sequence,
//! so that JetStream refuses the commit when the index was behind. A unit with little content or
//! much garbage is written as a whole, and the message rolls up its earlier ones: the stream
//! compacts itself.
//!
//! What an API key holds is the sum over many units. Commits of a key with little left of its
//! quota also write to a unit that they share, so that each is planned after all before it.

use std::collections::BTreeMap;

use uuid::Uuid;

use super::index::{Index, message_bytes};
use super::message::{
    FRAME_BYTES, Message, OBJECT_BYTES, PART_BYTES, Part, Value, WRITE_BYTES, Write, encode,
};
use super::spool::Stored;
use super::unit;
use crate::engine::{Account, Commit, CommitError, EngineError, Expected};
use crate::holding::{self, Bill, Held};

/// Maximum number of messages of an atomic batch, the server's default.
pub(super) const MESSAGES_MAX: usize = 1000;
/// Largest content of a unit that is written as a whole.
const WHOLE_BYTES_MAX: u64 = 4 << 20;
/// Time for which an empty unit's last message is kept, as a header has it.
const TOMBSTONE_TTL: &str = "24h";
/// Garbage that a unit may have.
const GARBAGE_BYTES: u64 = 16 << 10;

/// Bytes left of a quota below which commits are ordered. Chosen: more than all servers write for
/// one key within the milliseconds by which an index may be behind.
const QUOTA_LEFT_BYTES: u64 = 32 << 20;

/// Keys and their new values, `None` to remove them.
type Writes = BTreeMap<Vec<u8>, Option<Value>>;
/// Where the values are of keys whose content was put as objects.
pub(super) type Parts = BTreeMap<Vec<u8>, Part>;

/// A commit and how it is to be written.
#[derive(Debug)]
pub(super) struct Work {
    pub(super) commit: Commit,
    /// Units that are written as a whole, whatever the commit writes.
    pub(super) compacts: Vec<Vec<u8>>,
}

/// A message to publish.
#[derive(Debug)]
pub(super) struct Outgoing {
    pub(super) unit: Vec<u8>,
    /// The sequence that the unit's last message must have; `None` after its first message.
    pub(super) expected: Option<u64>,
    /// Whether it replaces all earlier messages of the unit.
    pub(super) is_rollup: bool,
    /// Time after which it vanishes, as a header has it.
    pub(super) ttl: Option<&'static str>,
    pub(super) payload: Vec<u8>,
}

/// The units that a commit reads or writes.
pub(super) fn units(work: &Work) -> Vec<Vec<u8>> {
    let commit = &work.commit;
    let written = commit.writes.iter().map(|(key, _)| unit::of(key));
    let expected = commit.expectations.iter().map(|(key, _)| unit::of(key));
    let mut units: Vec<_> = written.chain(expected).chain(work.compacts.iter().cloned()).collect();
    if let Some(account) = commit.account {
        let things = commit.writes.iter().filter_map(|(key, _)| holding::thing(key));
        let things = things.chain(commit.counted.iter().map(|(thing, _)| thing.clone()));
        units.extend(things.map(|thing| unit::of(&holding::key(&thing, account.key))));
    }
    units.sort_unstable();
    units.dedup();
    units
}

/// The messages of a commit; none if there is nothing to write or to check.
pub(super) fn plan(
    index: &Index,
    work: &Work,
    content: &Parts,
    id: Uuid,
    payload_max: usize,
) -> Result<Vec<Outgoing>, CommitError> {
    let commit = &work.commit;
    for (expectation, (key, expected)) in commit.expectations.iter().enumerate() {
        let found = index.get(key)?;
        let holds = match expected {
            Expected::Absent => found.is_none(),
            Expected::Value(value) => found.as_ref() == Some(value),
        };
        if !holds {
            return Err(CommitError::Conflict { expectation });
        }
    }
    let mut by_unit: BTreeMap<Vec<u8>, Writes> = BTreeMap::new();
    for id in units(work) {
        by_unit.insert(id, BTreeMap::new());
    }
    for (key, value) in writes(index, commit, content)? {
        by_unit.entry(unit::of(&key)).or_default().insert(key, value);
    }
    // A holding that stays as it is needs no message.
    let is_needed = |id: &[u8], writes: &Writes| {
        !writes.is_empty()
            || commit.expectations.iter().any(|(key, _)| unit::of(key) == id)
            || work.compacts.iter().any(|unit| unit == id)
    };
    by_unit.retain(|id, writes| is_needed(id, writes));
    if let Some(account) = commit.account.filter(|account| is_close(&index.held, account))
        && !by_unit.is_empty()
    {
        by_unit.insert(unit::quota(account.key), BTreeMap::new());
    }
    let mut parts = Vec::new();
    for (id, writes) in by_unit {
        parts.extend(of_unit(index, id, writes, work, payload_max)?);
    }
    if parts.len() > MESSAGES_MAX {
        let found = parts.len();
        let detail = format!("it touches {found} groups of records, expected at most 1000");
        return Err(EngineError::Failed { doing: "planning a commit", detail }.into());
    }
    let n_parts = parts.len() as u16;
    let outgoing = (0..n_parts).zip(parts).map(|(part, Unplaced { message, expected })| {
        let is_last_word = message.is_whole && message.writes.is_empty();
        let ttl = is_last_word.then_some(TOMBSTONE_TTL);
        let message = Message { commit: id, part, n_parts, ..message };
        let (is_rollup, payload) = (message.is_whole, encode(&message));
        Outgoing { unit: message.unit, expected, is_rollup, ttl, payload }
    });
    Ok(outgoing.collect())
}

/// Whether an account has so little left of its quota that its commits are ordered.
fn is_close(held: &Held, account: &Account) -> bool {
    account.quota.is_some() && held.check(*account, QUOTA_LEFT_BYTES).is_err()
}

/// The writes of a commit, the last of each key, and those of the holdings of its account.
fn writes(index: &Index, commit: &Commit, content: &Parts) -> Result<Writes, EngineError> {
    let value = |key: &Vec<u8>, value: &Vec<u8>| match content.get(key) {
        Some(part) => Value::There(*part),
        None => Value::Here(value.clone()),
    };
    let values = commit.writes.iter();
    let values = values.map(|(key, new)| (key.clone(), new.as_ref().map(|new| value(key, new))));
    let mut writes: Writes = values.collect();
    if let Some(mut bill) = Bill::of(commit) {
        for (key, value) in &writes {
            let before = index.pairs.get(key).as_ref().map(Stored::len);
            bill.add(key, before, value.as_ref().map(Value::len));
        }
        let holdings = bill.settle(&index.held, |key| index.get(key))?;
        let holdings = holdings.into_iter();
        writes.extend(holdings.map(|(key, record)| (key, Some(Value::Here(record)))));
    }
    Ok(writes)
}

/// Bytes of a new value in a message.
fn spoken_bytes(value: &Value) -> usize {
    match value {
        Value::Here(value) => value.len(),
        Value::There(_) => PART_BYTES,
    }
}

/// A stored value as a message has it: content stays where it is.
fn again(value: &Stored) -> Result<Value, EngineError> {
    match value {
        Stored::Content { object, at, length } => {
            let (object, at, length) = (object.described, *at, *length);
            Ok(Value::There(Part { object, at, length }))
        }
        Stored::Memory(_) | Stored::File { .. } => value.read().map(Value::Here),
    }
}

/// A message without its place.
struct Unplaced {
    message: Message,
    expected: Option<u64>,
}

/// The messages of one unit.
fn of_unit(
    index: &Index,
    id: Vec<u8>,
    writes: Writes,
    work: &Work,
    payload_max: usize,
) -> Result<Vec<Unplaced>, EngineError> {
    let state = index.unit(&id);
    let mut after = state.message_bytes;
    let mut delta = FRAME_BYTES as u64;
    for (key, value) in &writes {
        let size = |length: usize| (key.len() + length) as u64;
        after -= index.pairs.get(key).map_or(0, |before| size(message_bytes(&before)));
        after += value.as_ref().map_or(0, |value| size(spoken_bytes(value)));
        delta += size(value.as_ref().map_or(0, spoken_bytes)) + WRITE_BYTES as u64;
    }
    let is_cheap = after <= 2 * delta;
    let is_garbage = state.logged_bytes + delta > 3 * after + GARBAGE_BYTES;
    let is_forced = work.compacts.contains(&id);
    let is_whole = after <= WHOLE_BYTES_MAX && (is_cheap || is_garbage || is_forced);
    let writes: Vec<Write> = if is_whole {
        let mut whole = BTreeMap::new();
        for (key, value) in index.of_unit(&id) {
            if !writes.contains_key(&key[..]) {
                whole.insert(key.to_vec(), Some(again(&value)?));
            }
        }
        whole.extend(writes.into_iter().filter(|(_, value)| value.is_some()));
        whole.into_iter().collect()
    } else {
        writes.into_iter().collect()
    };
    let groups = groups(writes, payload_max.saturating_sub(FRAME_BYTES + id.len()));
    let parts = groups.into_iter().enumerate().map(|(number, writes)| {
        let (is_first, unit) = (number == 0, id.clone());
        let (commit, part, n_parts) = (Uuid::nil(), 0, 1);
        let is_whole = is_whole && is_first;
        let message = Message { commit, part, n_parts, unit, is_whole, writes };
        Unplaced { message, expected: is_first.then_some(state.sequence) }
    });
    Ok(parts.collect())
}

/// Writes in groups of at most `bytes_max`, at least one group.
fn groups(writes: Vec<Write>, bytes_max: usize) -> Vec<Vec<Write>> {
    let mut groups = vec![Vec::new()];
    let mut bytes = 0;
    for (key, value) in writes {
        let size = match &value {
            // Each may be in another object.
            Some(Value::There(_)) => WRITE_BYTES + key.len() + PART_BYTES + OBJECT_BYTES,
            Some(Value::Here(value)) => WRITE_BYTES + key.len() + value.len() + 2,
            None => WRITE_BYTES + key.len() + 2,
        };
        if bytes > 0 && bytes + size > bytes_max {
            groups.push(Vec::new());
            bytes = 0;
        }
        bytes += size;
        groups.last_mut().expect("it begins with one group").push((key, value));
    }
    groups
}
