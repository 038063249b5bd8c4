//! The tally: the number of commits and a sum over all pairs, written with each commit.
//!
//! If sled drops a page, its keys are missing without a trace in the remaining pages. The sum
//! detects this: it adds, modulo 2¹²⁸, the first 16 bytes of BLAKE3 over the key's length (u32),
//! the key and the value of every pair. A commit updates it by its own writes.

use crate::envelope::{self, Kind};

/// The tally's key. No commit may write a key that begins with it.
pub(super) const TALLY_KEY: [u8; 1] = [0];
/// Schema of its record.
const SCHEMA: u16 = 1;

/// The number of commits, and the sum of all pairs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Tally {
    pub(super) commits: u64,
    pub(super) sum: u128,
}

impl Tally {
    /// Its stored form: commits u64, sum u128, little-endian, in an envelope.
    pub(super) fn to_record(self) -> Vec<u8> {
        let payload = [&self.commits.to_le_bytes()[..], &self.sum.to_le_bytes()[..]].concat();
        envelope::seal(Kind::Tally, SCHEMA, &payload)
    }

    /// The tally of a record; `None` if it is damaged.
    pub(super) fn from_record(bytes: &[u8]) -> Option<Self> {
        let opened = envelope::open(Kind::Tally, bytes).ok()?;
        let (commits, sum) = opened.payload.split_first_chunk::<8>()?;
        let sum = <[u8; 16]>::try_from(sum).ok()?;
        let is_known = opened.schema == SCHEMA;
        is_known
            .then(|| Self { commits: u64::from_le_bytes(*commits), sum: u128::from_le_bytes(sum) })
    }

    pub(super) fn add(&mut self, key: &[u8], value: &[u8]) {
        self.sum = self.sum.wrapping_add(summand(key, value));
    }

    pub(super) fn remove(&mut self, key: &[u8], value: &[u8]) {
        self.sum = self.sum.wrapping_sub(summand(key, value));
    }
}

/// Totals of the levels, or the difference that upper levels make.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Contents {
    pub(super) sum: u128,
    pub(super) n_pairs: u64,
    /// Bytes of all keys and values.
    pub(super) live_bytes: u64,
}

impl Contents {
    pub(super) fn add(&mut self, key: &[u8], value: &[u8]) {
        self.sum = self.sum.wrapping_add(summand(key, value));
        self.n_pairs = self.n_pairs.wrapping_add(1);
        self.live_bytes = self.live_bytes.wrapping_add((key.len() + value.len()) as u64);
    }

    /// Removes a pair from the totals.
    pub(super) fn remove(&mut self, key: &[u8], value: &[u8]) {
        self.sum = self.sum.wrapping_sub(summand(key, value));
        self.n_pairs = self.n_pairs.wrapping_sub(1);
        self.live_bytes = self.live_bytes.wrapping_sub((key.len() + value.len()) as u64);
    }

    /// The sum of both. A difference may be negative: numbers wrap around.
    pub(super) fn plus(self, other: Self) -> Self {
        Self {
            sum: self.sum.wrapping_add(other.sum),
            n_pairs: self.n_pairs.wrapping_add(other.n_pairs),
            live_bytes: self.live_bytes.wrapping_add(other.live_bytes),
        }
    }
}

fn summand(key: &[u8], value: &[u8]) -> u128 {
    let mut hasher = blake3::Hasher::new();
    // A key has at most 256 bytes.
    hasher.update(&(key.len() as u32).to_le_bytes());
    hasher.update(key);
    hasher.update(value);
    let mut bytes = [0; 16];
    hasher.finalize_xof().fill(&mut bytes);
    u128::from_le_bytes(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sum_ignores_order_and_removed_pairs() {
        let (mut first, mut second) = (Tally::default(), Tally::default());
        first.add(b"a", b"1");
        first.add(b"b", b"2");
        second.add(b"c", b"3");
        second.add(b"b", b"2");
        second.add(b"a", b"1");
        assert_ne!(first.sum, second.sum);
        second.remove(b"c", b"3");
        assert_eq!(first.sum, second.sum);
        let mut shifted = Tally::default();
        shifted.add(b"a1", b"");
        shifted.add(b"b", b"2");
        assert_ne!(first.sum, shifted.sum, "the key's end counts");
    }

    #[test]
    fn a_tally_reads_back_and_a_flipped_bit_is_detected() {
        let tally = Tally { commits: 7, sum: 0x0123_4567_89ab_cdef_0011 };
        let bytes = tally.to_record();
        assert_eq!(Tally::from_record(&bytes), Some(tally));
        for bit in 0..bytes.len() * 8 {
            let mut flipped = bytes.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            assert_eq!(Tally::from_record(&flipped), None, "bit {bit}");
        }
    }
}
