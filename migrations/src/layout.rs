//! The layout number of a database, the one record whose form never changes.

use palpate_store::engine::{Commit, Engine, Expected};
use palpate_store::envelope::{self, Kind};

use crate::MigrateError;
use crate::raw::hex;

/// Key of the layout record.
const KEY: &[u8] = b"!";
/// Schema of the layout record.
const SCHEMA: u16 = 1;

/// The layout number; `None` in an empty database.
///
/// # Errors
/// [`MigrateError::NoLayout`], [`MigrateError::Damaged`]; the engine's.
pub fn layout(engine: &dyn Engine) -> Result<Option<u32>, MigrateError> {
    let Some(bytes) = engine.get(KEY)? else {
        let is_empty = engine.scan(&[], None, 1)?.is_empty();
        return if is_empty { Ok(None) } else { Err(MigrateError::NoLayout) };
    };
    let (number, _) = parts(&bytes)?;
    Ok(Some(number))
}

/// Writes a new number; the creator of the database, in the same record, stays.
pub(crate) fn set(engine: &dyn Engine, number: u32) -> Result<(), MigrateError> {
    let before = engine.get(KEY)?.ok_or(MigrateError::NoLayout)?;
    let (_, made_by) = parts(&before)?;
    let payload = [&number.to_le_bytes()[..], made_by].concat();
    let record = envelope::seal(Kind::Layout, SCHEMA, &payload);
    let commit = Commit::new().expect(KEY.to_vec(), Expected::Value(before.clone()));
    Ok(engine.commit(commit.put(KEY.to_vec(), record)).wait()?)
}

/// The number, and the bytes after it.
fn parts(record: &[u8]) -> Result<(u32, &[u8]), MigrateError> {
    let key = || hex(KEY);
    let opened = envelope::open(Kind::Layout, record)
        .map_err(|source| MigrateError::Damaged { key: key(), source })?;
    let schema = opened.schema;
    let unreadable = || MigrateError::Unreadable { key: key(), schema };
    let (number, rest) = opened.payload.split_first_chunk::<4>().ok_or_else(unreadable)?;
    Ok((u32::from_le_bytes(*number), rest))
}
