//! Which members hold a block: rendezvous hashing, a function of their ids alone.
//!
//! Each pair of a block and a member has a weight; the members with the highest weights hold the
//! block. So all servers that know the same members agree without a word, and when a member leaves
//! or joins only the blocks move that it held or gets.

use std::cmp::Reverse;

use uuid::Uuid;

/// A block of 64 consecutive objects of a version.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct Block {
    pub(crate) catalogue: Uuid,
    pub(crate) version: u32,
    /// Number of the block, from 0.
    pub(crate) number: u32,
}

/// A member among whom blocks are placed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Seat {
    /// Id of its data folder, which determines its blocks: they stay through a restart.
    pub(crate) place: Uuid,
    /// Id of its process.
    pub(crate) member: Uuid,
}

/// The members that hold a block, the first copy first: `copies` of them, or all if they are
/// fewer.
pub(crate) fn holders(block: &Block, seats: &[Seat], copies: usize) -> Vec<Uuid> {
    let mut weighed: Vec<(u64, Seat)> =
        seats.iter().map(|s| (weight(block, s.place), *s)).collect();
    weighed.sort_unstable_by_key(|(weight, seat)| (Reverse(*weight), *seat));
    weighed.iter().take(copies).map(|(_, seat)| seat.member).collect()
}

/// Weight of a block at a place: evenly distributed, and independent of all others.
fn weight(block: &Block, place: Uuid) -> u64 {
    let mut hasher = blake3::Hasher::new();
    hasher.update(block.catalogue.as_bytes());
    hasher.update(&block.version.to_le_bytes());
    hasher.update(&block.number.to_le_bytes());
    hasher.update(place.as_bytes());
    hasher.finalize().as_bytes().first_chunk().map_or(0, |first| u64::from_le_bytes(*first))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    fn seats(n: u128) -> Vec<Seat> {
        let seat = |n| Seat { place: Uuid::from_u128(n), member: Uuid::from_u128(1000 + n) };
        (1..=n).map(seat).collect()
    }

    fn blocks(n: u32) -> impl Iterator<Item = Block> {
        (0..n).map(|number| Block { catalogue: Uuid::from_u128(7), version: 3, number })
    }

    #[test]
    fn copies_are_on_distinct_members() {
        for (n, copies, expected) in [(1, 2, 1), (2, 2, 2), (5, 2, 2), (5, 3, 3), (0, 2, 0)] {
            for block in blocks(50) {
                let mut found = holders(&block, &seats(n), copies);
                found.sort_unstable();
                found.dedup();
                assert_eq!(found.len(), expected);
            }
        }
    }

    #[test]
    fn blocks_are_spread_evenly() {
        // 4,000 copies over 4 members: 1,000 each, standard deviation below √(2000 · ½ · ½) = 23.
        let mut held: BTreeMap<Uuid, u32> = BTreeMap::new();
        for block in blocks(2000) {
            for member in holders(&block, &seats(4), 2) {
                *held.entry(member).or_default() += 1;
            }
        }
        assert_eq!(held.len(), 4);
        assert!(held.values().all(|n| n.abs_diff(1000) < 115), "{held:?}");
    }

    #[test]
    fn only_blocks_of_the_one_that_leaves_or_joins_move() {
        let (four, mut three) = (seats(4), seats(4));
        let gone = three.remove(1).member;
        for block in blocks(500) {
            let (before, after) = (holders(&block, &four, 2), holders(&block, &three, 2));
            let stay: Vec<Uuid> = before.iter().copied().filter(|member| *member != gone).collect();
            assert!(after.starts_with(&stay), "{before:?} {after:?}");
            assert_eq!(before.contains(&gone), before != after);
        }
    }

    #[test]
    fn the_order_of_members_does_not_matter() {
        let (there, mut back) = (seats(6), seats(6));
        back.reverse();
        for block in blocks(50) {
            assert_eq!(holders(&block, &there, 3), holders(&block, &back, 3));
        }
    }

    #[test]
    fn a_member_that_starts_again_gets_its_blocks_back() {
        let (before, mut after) = (seats(4), seats(4));
        let renewed = Uuid::from_u128(77);
        after[2].member = renewed;
        for block in blocks(100) {
            let held = |seats: &[Seat], member| holders(&block, seats, 2).contains(&member);
            assert_eq!(held(&before, before[2].member), held(&after, renewed));
        }
    }
}
