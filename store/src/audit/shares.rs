//! The entries of a ring, with the share of each API key: the key with most entries makes room, so
//! that no key pushes entries of others out of the log.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};

use uuid::Uuid;

/// The key that made a request; `None` without one.
pub(super) type Maker = Option<Uuid>;

/// Sequence numbers and their makers.
#[derive(Debug, Default)]
pub(super) struct Shares {
    makers: BTreeMap<u64, Maker>,
    shares: BTreeMap<Maker, BTreeSet<u64>>,
}

impl Shares {
    pub(super) fn insert(&mut self, seq: u64, maker: Maker) {
        self.remove(seq);
        self.makers.insert(seq, maker);
        self.shares.entry(maker).or_default().insert(seq);
    }

    pub(super) fn remove(&mut self, seq: u64) {
        let Some(maker) = self.makers.remove(&seq) else { return };
        let Some(share) = self.shares.get_mut(&maker) else { return };
        share.remove(&seq);
        if share.is_empty() {
            self.shares.remove(&maker);
        }
    }

    pub(super) fn contains(&self, seq: u64) -> bool {
        self.makers.contains_key(&seq)
    }

    pub(super) fn len(&self) -> u64 {
        self.makers.len() as u64
    }

    pub(super) fn last(&self) -> Option<u64> {
        self.makers.last_key_value().map(|(seq, _)| *seq)
    }

    /// Up to `limit` numbers below `end`, largest first.
    pub(super) fn before(&self, end: Option<u64>, limit: usize) -> impl Iterator<Item = u64> {
        self.makers.range(..end.unwrap_or(u64::MAX)).rev().take(limit).map(|(seq, _)| *seq)
    }

    /// The entry that makes room: the oldest settled one of the largest share that has one.
    pub(super) fn next_out(&self, pending: &BTreeSet<u64>) -> Option<u64> {
        let oldest = |share: &BTreeSet<u64>| {
            let first = share.iter().find(|seq| !pending.contains(seq)).copied();
            first.map(|first| (share.len(), Reverse(first)))
        };
        self.shares.values().filter_map(oldest).max().map(|(_, Reverse(seq))| seq)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every key floods a ring that holds one entry of every other.
    #[test]
    fn no_key_pushes_entries_of_another_out() {
        let keys: Vec<Maker> = (0..10).map(|key| (key > 0).then(|| Uuid::from_u128(key))).collect();
        for flood in &keys {
            let mut ring = Shares::default();
            (0..).zip(&keys).for_each(|(seq, key)| ring.insert(seq, *key));
            let pending = BTreeSet::from([3]);
            for seq in 10..500 {
                ring.insert(seq, *flood);
                if ring.len() > 20 {
                    ring.remove(ring.next_out(&pending).unwrap());
                }
            }
            for (seq, key) in (0..).zip(&keys) {
                assert!(ring.contains(seq) || key == flood, "{key:?} by {flood:?}");
            }
            assert_eq!((ring.len(), ring.last()), (20, Some(499)));
        }
    }
}
