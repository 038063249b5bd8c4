//! Layout 1 to 2: journal entries of schemas 1, 2 and 3 become schema 4.
//!
//! Schema 2 added the calibration's number, 3 made the pose optional and added the client's
//! feature, 4 added the approach and the possible motion of the object. Missing values are
//! written as such: no calibration (0), no feature, no approach (0 m), no motion. With layout
//! 2 the engine also keeps its tally, which an older Palpate would not update.

use palpate_store::engine::{Commit, Engine, Pair, pages};
use palpate_store::envelope::{self, Kind};

use crate::MigrateError;
use crate::raw::{hex, replace, whole};

/// Key spaces of journal entries: training and sessions.
const SPACES: [u8; 2] = [b't', b'r'];
/// An entry's key: letter, owner (16), number (8).
const KEY_BYTES: usize = 25;
/// The schema written.
const SCHEMA: u16 = 4;
/// Number of keys per read.
const KEYS_PER_READ: usize = 256;
/// Number of entries per commit.
const ENTRIES_PER_COMMIT: usize = 64;

/// Bytes of a position and a quaternion.
const POSE_BYTES: usize = 7 * 8;

pub(crate) fn run(engine: &dyn Engine) -> Result<u64, MigrateError> {
    let mut n_changed = 0;
    for space in SPACES {
        for page in pages(engine, &[space], None, KEYS_PER_READ) {
            let heads = page?.into_iter().filter(|(key, _)| key.len() == KEY_BYTES);
            let heads: Vec<Pair> = heads.collect();
            for group in heads.chunks(ENTRIES_PER_COMMIT) {
                n_changed += change(engine, group)?;
            }
        }
    }
    Ok(n_changed)
}

fn change(engine: &dyn Engine, heads: &[Pair]) -> Result<u64, MigrateError> {
    let mut commit = Commit::new();
    let mut n_changed = 0;
    for (key, first) in heads {
        let record = whole(engine, key, first)?;
        let damaged = |source| MigrateError::Damaged { key: hex(key), source };
        let opened = envelope::open(Kind::JournalEntry, &record).map_err(damaged)?;
        let schema = opened.schema;
        if schema >= SCHEMA {
            continue;
        }
        let payload = upgraded(opened.payload, schema)
            .ok_or_else(|| MigrateError::Unreadable { key: hex(key), schema })?;
        let record = envelope::seal(Kind::JournalEntry, SCHEMA, &payload);
        commit = replace(commit, key, first.clone(), &record);
        n_changed += 1;
    }
    if n_changed > 0 {
        engine.commit(commit).wait()?;
    }
    Ok(n_changed)
}

/// A payload of schema 4 from one of an earlier schema; `None` when it is malformed.
fn upgraded(payload: &[u8], schema: u16) -> Option<Vec<u8>> {
    if !(1..SCHEMA).contains(&schema) {
        return None;
    }
    let mut copy = Copying { rest: payload, written: Vec::with_capacity(payload.len() + 32) };
    // The entry's number and its time of arrival.
    copy.bytes(16)?;
    if copy.option()? {
        copy.list()?;
        copy.bytes(8)?;
    }
    match copy.variant()? {
        0 => reading(&mut copy, schema)?,
        1 => copy.bytes(8)?,
        2 => {}
        _ => return None,
    }
    copy.rest.is_empty().then_some(copy.written)
}

fn reading(copy: &mut Copying<'_>, schema: u16) -> Option<()> {
    // The sensor.
    copy.bytes(16)?;
    let has_pose = if schema < 3 { copy.write(&[1]) } else { copy.option()? };
    if has_pose {
        copy.bytes(POSE_BYTES)?;
    }
    if copy.option()? {
        copy.bytes(8)?;
    }
    // The pressures, then the calibration.
    copy.list()?;
    if schema < 2 {
        copy.write(&0u32.to_le_bytes());
    } else {
        copy.bytes(4)?;
    }
    if schema < 3 {
        copy.write(&[0]);
    } else if copy.option()? {
        copy.list()?;
    }
    copy.write(&0.0f64.to_le_bytes());
    copy.write(&[0]);
    Some(())
}

/// A cursor that copies fields one after the other.
struct Copying<'a> {
    rest: &'a [u8],
    written: Vec<u8>,
}

impl Copying<'_> {
    fn bytes(&mut self, n: usize) -> Option<()> {
        let (copied, rest) = self.rest.split_at_checked(n)?;
        self.written.extend_from_slice(copied);
        self.rest = rest;
        Some(())
    }

    /// Copies a length (u64) and that many bytes.
    fn list(&mut self) -> Option<()> {
        let length = u64::from_le_bytes(*self.rest.first_chunk::<8>()?);
        self.bytes(8)?;
        self.bytes(usize::try_from(length).ok()?)
    }

    /// Copies the tag of an option; whether a value follows.
    fn option(&mut self) -> Option<bool> {
        let is_there = match self.rest.first()? {
            0 => false,
            1 => true,
            _ => return None,
        };
        self.bytes(1)?;
        Some(is_there)
    }

    fn variant(&mut self) -> Option<u32> {
        let variant = u32::from_le_bytes(*self.rest.first_chunk::<4>()?);
        self.bytes(4)?;
        Some(variant)
    }

    /// Writes the bytes of a missing value; always true, since a value is present afterwards.
    fn write(&mut self, bytes: &[u8]) -> bool {
        self.written.extend_from_slice(bytes);
        true
    }
}
