//! Records as bytes under keys, joined from and split into pieces as in layouts 1 and 2.

use palpate_store::engine::{Commit, Engine, Expected};
use palpate_store::envelope;

use crate::MigrateError;

/// Longest value of a key, in bytes.
const PIECE_BYTES: usize = 4096;

/// The record whose first piece lies under `head`.
pub(crate) fn whole(
    engine: &dyn Engine,
    head: &[u8],
    first: &[u8],
) -> Result<Vec<u8>, MigrateError> {
    let damaged = |source| MigrateError::Damaged { key: hex(head), source };
    let total = envelope::total_bytes(first).map_err(damaged)?;
    let mut record = first.to_vec();
    for number in 1u32.. {
        if record.len() >= total {
            break;
        }
        let Some(piece) = engine.get(&piece_key(head, number))? else { break };
        record.extend_from_slice(&piece);
    }
    Ok(record)
}

/// Adds to a commit the replacement of the record under `head`, with this first piece, by a
/// record that is not shorter.
pub(crate) fn replace(commit: Commit, head: &[u8], first: Vec<u8>, record: &[u8]) -> Commit {
    let commit = commit.expect(head.to_vec(), Expected::Value(first));
    (0u32..).zip(record.chunks(PIECE_BYTES)).fold(commit, |commit, (number, piece)| {
        let key = if number == 0 { head.to_vec() } else { piece_key(head, number) };
        commit.put(key, piece.to_vec())
    })
}

/// Bytes in hexadecimal.
pub(crate) fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn piece_key(head: &[u8], number: u32) -> Vec<u8> {
    [head, &number.to_be_bytes()].concat()
}
