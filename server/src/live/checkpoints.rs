//! Checkpoints of beliefs, in files, which save folding after a restart.
//!
//! They are derived from the journal and may be missing, old or torn without harm. A
//! checkpoint is used only if the very same program made it, on a processor of the same
//! abilities, for the same version of the catalogue, from the first readings of the session's
//! order. So the belief is the same, bit for bit, with and without it.

use std::path::PathBuf;

use uuid::Uuid;

use crate::derived::DerivedFiles;
use crate::program::{HASH_BYTES, program};

/// Magic number of the files: Palpate's checkpoints, first format.
const MAGIC: [u8; 8] = *b"PALPCHK1";
/// Maximum length of a checkpoint's file, bytes.
const BYTES_MAX: u64 = 64 << 20;

/// The checkpoints of sessions.
#[derive(Debug)]
pub(crate) struct Checkpoints(DerivedFiles);

/// A checkpoint and the readings behind it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Checkpoint {
    pub(crate) catalogue: Uuid,
    pub(crate) version: u32,
    /// Numbers of the readings of the presses, in folding order, as `live::order` stores them.
    pub(crate) order: Vec<u32>,
    pub(crate) conclusions: Vec<u8>,
}

impl Checkpoints {
    /// Checkpoints in a folder that is created with the first one.
    pub(crate) fn new(folder: PathBuf) -> Self {
        Self(DerivedFiles::new(folder, "a checkpoint", BYTES_MAX))
    }

    /// Replaces the session's checkpoint. Blocks.
    pub(crate) fn keep(&self, session: Uuid, checkpoint: &Checkpoint) {
        let Some(program) = program() else { return };
        self.0.keep(session, &encode(program, checkpoint));
    }

    /// The session's checkpoint, if it was made by this program. Blocks.
    pub(crate) fn find(&self, session: Uuid) -> Option<Checkpoint> {
        let bytes = self.0.find(session)?;
        decode(program()?, &bytes)
    }

    /// Removes a session's checkpoint. Blocks.
    pub(crate) fn remove(&self, session: Uuid) {
        self.0.remove(session);
    }

    /// Removes every file that is not a checkpoint of a session that stays. Blocks.
    pub(crate) fn tidy(&self, stays: impl Fn(Uuid) -> bool) {
        self.0.tidy(stays);
    }
}

/// Magic, hash of the rest, program, catalogue, version, order with its length, conclusions.
fn encode(program: [u8; HASH_BYTES], checkpoint: &Checkpoint) -> Vec<u8> {
    let Checkpoint { catalogue, version, order, conclusions } = checkpoint;
    let mut rest = Vec::with_capacity(64 + 4 * order.len() + conclusions.len());
    rest.extend_from_slice(&program);
    rest.extend_from_slice(catalogue.as_bytes());
    rest.extend_from_slice(&version.to_le_bytes());
    rest.extend_from_slice(&(order.len() as u32).to_le_bytes());
    order.iter().for_each(|number| rest.extend_from_slice(&number.to_le_bytes()));
    rest.extend_from_slice(conclusions);
    [&MAGIC[..], blake3::hash(&rest).as_bytes(), &rest].concat()
}

fn decode(program: [u8; HASH_BYTES], bytes: &[u8]) -> Option<Checkpoint> {
    let rest = bytes.strip_prefix(&MAGIC)?;
    let (hash, rest) = rest.split_first_chunk::<HASH_BYTES>()?;
    let (made_by, after) = rest.split_first_chunk::<HASH_BYTES>()?;
    if *hash != *blake3::hash(rest).as_bytes() || *made_by != program {
        return None;
    }
    let (catalogue, after) = after.split_first_chunk()?;
    let (version, after) = after.split_first_chunk()?;
    let (n, after) = after.split_first_chunk()?;
    let (order, conclusions) =
        after.split_at_checked((u32::from_le_bytes(*n) as usize).checked_mul(4)?)?;
    let (numbers, _) = order.as_chunks::<4>();
    Some(Checkpoint {
        catalogue: Uuid::from_bytes(*catalogue),
        version: u32::from_le_bytes(*version),
        order: numbers.iter().map(|number| u32::from_le_bytes(*number)).collect(),
        conclusions: conclusions.to_vec(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn checkpoint() -> Checkpoint {
        let (catalogue, order) = (Uuid::from_u128(7), vec![2, 0, 1]);
        Checkpoint { catalogue, version: 3, order, conclusions: b"sure".to_vec() }
    }

    #[test]
    fn checkpoints_are_found_until_removed_or_tidied() {
        let folder = tempfile::tempdir().unwrap();
        let checkpoints = Checkpoints::new(folder.path().join("checkpoints"));
        let [a, b] = [1, 2].map(Uuid::from_u128);
        assert_eq!(checkpoints.find(a), None);
        checkpoints.remove(a);
        for session in [a, b] {
            checkpoints.keep(session, &checkpoint());
        }
        assert_eq!(checkpoints.find(a), Some(checkpoint()));
        checkpoints.remove(a);
        assert_eq!(checkpoints.find(a), None);
        checkpoints.tidy(|session| session == b);
        assert_eq!(checkpoints.find(b), Some(checkpoint()));
        checkpoints.tidy(|_| false);
        assert_eq!(checkpoints.find(b), None);
    }

    #[test]
    fn damaged_and_foreign_checkpoints_are_not_used() {
        let bytes = encode([1; HASH_BYTES], &checkpoint());
        assert_eq!(decode([1; HASH_BYTES], &bytes), Some(checkpoint()));
        assert_eq!(decode([2; HASH_BYTES], &bytes), None);
        for cut in 0..bytes.len() {
            assert_eq!(decode([1; HASH_BYTES], &bytes[..cut]), None, "{cut} bytes");
        }
        for at in 0..bytes.len() {
            let mut flipped = bytes.clone();
            flipped[at] ^= 1;
            assert_eq!(decode([1; HASH_BYTES], &flipped), None, "at {at}");
        }
    }
}
