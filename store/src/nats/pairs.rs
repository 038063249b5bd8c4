//! Keys in their order with where their values are. The pieces of a record that follow one another
//! in an object of content are one entry, so that content takes little memory.
//!
//! Law, tested against a map of single keys: what is found does not depend on what is joined.
//! Keys of a run are equal but for their last four bytes, which count up, as `key::piece` makes
//! them; their values lie one behind the other, all of one length but the last, which may be
//! shorter. A key within a run that is set or removed, or a longer one between two of its keys,
//! divides it.

use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::ops::Bound;
use std::sync::Arc;

/// Bytes of the number at the end of a piece's key.
const NUMBER_BYTES: usize = 4;

/// Where a value is.
pub(super) trait Place: Clone {
    /// The whole in which it lies beside others, its offset and its length; `None` if it is alone.
    fn part(&self) -> Option<(usize, u32, u16)>;

    /// Another part of the same whole.
    fn beside(&self, at: u32, length: u16) -> Self;
}

/// Keys with the places of their values.
#[derive(Debug)]
pub(super) struct Pairs<P>(BTreeMap<Arc<[u8]>, Entry<P>>);

/// One key, or the first of several.
#[derive(Clone, Debug)]
pub(super) enum Entry<P> {
    One(P),
    Run(Box<Run<P>>),
}

/// At least two keys with the parts of one whole.
#[derive(Clone, Debug)]
pub(super) struct Run<P> {
    first: P,
    n: u32,
    /// Length of the last value.
    last: u16,
}

impl<P> Default for Pairs<P> {
    fn default() -> Self {
        Self(BTreeMap::new())
    }
}

impl<P: Place> Pairs<P> {
    pub(super) fn get(&self, key: &[u8]) -> Option<P> {
        let up_to = (Bound::Unbounded, Bound::Included(key));
        let (first, entry) = self.0.range::<[u8], _>(up_to).next_back()?;
        let place = place(first, key)?;
        (place < entry.n()).then(|| entry.value(place))
    }

    /// Sets a key; returns what it had.
    pub(super) fn insert(&mut self, key: &[u8], value: P) -> Option<P> {
        let before = self.remove(key);
        let up_to = (Bound::Unbounded, Bound::Excluded(key));
        let previous = self.0.range_mut::<[u8], _>(up_to).next_back();
        let is_joined = previous.is_some_and(|(first, entry)| {
            place(first, key) == Some(entry.n()) && entry.join(&value)
        });
        if !is_joined {
            self.0.insert(key.into(), Entry::One(value));
        }
        before
    }

    /// Removes a key; returns what it had. No run goes on from one side of it to the other.
    pub(super) fn remove(&mut self, key: &[u8]) -> Option<P> {
        let up_to = (Bound::Unbounded, Bound::Included(key));
        let (first, entry) = self.0.range::<[u8], _>(up_to).next_back()?;
        let n_before = entry.n_before(first, key);
        let n = entry.n();
        if n_before == n {
            return None;
        }
        let is_there = order(first, n_before, key) == Ordering::Equal;
        let first = Arc::clone(first);
        let entry = self.0.remove(&first)?;
        let n_until = n_before + u32::from(is_there);
        for (from, to) in [(0, n_before), (n_until, n)] {
            if from < to {
                self.0.insert(numbered(&first, from), entry.slice(from, to));
            }
        }
        is_there.then(|| entry.value(n_before))
    }

    /// The keys from `start` on, or after it.
    pub(super) fn from(&self, start: Bound<&[u8]>) -> impl Iterator<Item = (Arc<[u8]>, P)> {
        let (Bound::Included(key) | Bound::Excluded(key)) = start else {
            unreachable!("a scan has a start")
        };
        let up_to = (Bound::Unbounded, Bound::Included(key));
        let before = self.0.range::<[u8], _>(up_to).next_back();
        let behind = self.0.range::<[u8], _>((Bound::Excluded(key), Bound::Unbounded));
        let before = before.into_iter().flat_map(move |(first, entry)| {
            let n_before = entry.n_before(first, key);
            let is_met = n_before < entry.n() && order(first, n_before, key) == Ordering::Equal;
            let skips_it = is_met && matches!(start, Bound::Excluded(_));
            members(first, entry, n_before + u32::from(skips_it))
        });
        before.chain(behind.flat_map(|(first, entry)| members(first, entry, 0)))
    }

    /// All entries as they are; [`expanded`] makes pairs of them.
    pub(super) fn entries(&self) -> Vec<(Arc<[u8]>, Entry<P>)> {
        self.0.iter().map(|(first, entry)| (Arc::clone(first), entry.clone())).collect()
    }
}

/// The pairs of an entry.
pub(super) fn expanded<P: Place>(
    (first, entry): (Arc<[u8]>, Entry<P>),
) -> impl Iterator<Item = (Arc<[u8]>, P)> {
    (0..entry.n()).map(move |place| (numbered(&first, place), entry.value(place)))
}

/// The pairs of an entry from a place on.
fn members<P: Place>(
    first: &Arc<[u8]>,
    entry: &Entry<P>,
    from: u32,
) -> impl Iterator<Item = (Arc<[u8]>, P)> {
    (from..entry.n()).map(move |place| (numbered(first, place), entry.value(place)))
}

impl<P: Place> Entry<P> {
    fn n(&self) -> u32 {
        match self {
            Self::One(_) => 1,
            Self::Run(run) => run.n,
        }
    }

    /// The value at a place within it.
    fn value(&self, place: u32) -> P {
        let Self::Run(run) = self else { return self.first().clone() };
        let Some((_, at, length)) = run.first.part() else { return run.first.clone() };
        let at = at + place * u32::from(length);
        run.first.beside(at, if place + 1 == run.n { run.last } else { length })
    }

    fn first(&self) -> &P {
        match self {
            Self::One(value) => value,
            Self::Run(run) => &run.first,
        }
    }

    /// Takes a value behind its last one, if it lies there.
    fn join(&mut self, value: &P) -> bool {
        let n = self.n();
        let (Some((whole, at, length)), Some((_, last_at, last))) =
            (self.first().part(), self.value(n - 1).part())
        else {
            return false;
        };
        let Some((its_whole, its_at, its_length)) = value.part() else { return false };
        let follows = last_at.checked_add(u32::from(last)) == Some(its_at) && at <= its_at;
        if its_whole != whole || !follows || last != length || its_length > length {
            return false;
        }
        let first = self.first().clone();
        *self = Self::Run(Box::new(Run { first, n: n + 1, last: its_length }));
        true
    }

    /// The entry of some of its keys.
    fn slice(&self, from: u32, to: u32) -> Self {
        let first = self.value(from);
        if to - from == 1 {
            return Self::One(first);
        }
        let last = self.value(to - 1).part().map_or(0, |(_, _, length)| length);
        Self::Run(Box::new(Run { first, n: to - from, last }))
    }

    /// Number of its keys that are less than `key`.
    fn n_before(&self, first: &[u8], key: &[u8]) -> u32 {
        let (mut low, mut high) = (0, self.n());
        // The usual case: all are.
        if order(first, high - 1, key) == Ordering::Less {
            return high;
        }
        while low < high {
            let middle = low + (high - low) / 2;
            match order(first, middle, key) {
                Ordering::Less => low = middle + 1,
                Ordering::Equal | Ordering::Greater => high = middle,
            }
        }
        low
    }
}

/// The place of a key in a run that begins with `first`, however long the run is.
fn place(first: &[u8], key: &[u8]) -> Option<u32> {
    if first == key {
        return Some(0);
    }
    let ((prefix, number), (its_prefix, its_number)) = (divided(first)?, divided(key)?);
    if prefix == its_prefix { its_number.checked_sub(number) } else { None }
}

/// A key before its number, and the number.
fn divided(key: &[u8]) -> Option<(&[u8], u32)> {
    let (prefix, number) = key.split_last_chunk::<NUMBER_BYTES>()?;
    Some((prefix, u32::from_be_bytes(*number)))
}

/// The key at a place of a run that begins with `first`.
fn numbered(first: &Arc<[u8]>, place: u32) -> Arc<[u8]> {
    match divided(first) {
        Some((prefix, number)) if place > 0 => {
            [prefix, &number.saturating_add(place).to_be_bytes()].concat().into()
        }
        _ => Arc::clone(first),
    }
}

/// The order of the key at a place of a run that begins with `first`, and of `key`.
fn order(first: &[u8], place: u32, key: &[u8]) -> Ordering {
    match divided(first) {
        Some((prefix, number)) if place > 0 => {
            let number = number.saturating_add(place).to_be_bytes();
            prefix.iter().chain(&number).cmp(key)
        }
        _ => first.cmp(key),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Alone, or a part of a whole.
    #[derive(Clone, Debug, PartialEq, Eq)]
    enum Test {
        Alone(u32),
        Part { whole: usize, at: u32, length: u16 },
    }

    impl Place for Test {
        fn part(&self) -> Option<(usize, u32, u16)> {
            match *self {
                Self::Alone(_) => None,
                Self::Part { whole, at, length } => Some((whole, at, length)),
            }
        }

        fn beside(&self, at: u32, length: u16) -> Self {
            match *self {
                Self::Alone(_) => panic!("it has no whole"),
                Self::Part { whole, .. } => Self::Part { whole, at, length },
            }
        }
    }

    /// Numbers of a linear congruential generator.
    fn numbers(seed: u64) -> impl FnMut(u32) -> u32 {
        let mut state = seed;
        move |end| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            ((state >> 33) % u64::from(end)) as u32
        }
    }

    fn key(record: u8, piece: u32) -> Vec<u8> {
        [&[b'b', record][..], &piece.to_be_bytes()].concat()
    }

    #[track_caller]
    fn compare(pairs: &Pairs<Test>, expected: &BTreeMap<Vec<u8>, Test>, probe: &[u8]) {
        assert_eq!(pairs.get(probe), expected.get(probe).cloned(), "{probe:?}");
        for start in [Bound::Included(probe), Bound::Excluded(probe)] {
            let found: Vec<_> =
                pairs.from(start).map(|(key, value)| (key.to_vec(), value)).collect();
            let range = expected.range::<[u8], _>((start, Bound::Unbounded));
            let wanted: Vec<_> = range.map(|(key, value)| (key.clone(), value.clone())).collect();
            assert_eq!(found, wanted, "from {start:?}");
        }
        let all: Vec<_> = pairs.entries().into_iter().flat_map(expanded).collect();
        assert!(
            all.iter()
                .map(|(key, value)| (&key[..], value))
                .eq(expected.iter().map(|(key, value)| (&key[..], value)))
        );
    }

    #[test]
    fn what_is_found_does_not_depend_on_what_is_joined() {
        for seed in 0..60 {
            let mut random = numbers(seed);
            let (mut pairs, mut expected) = (Pairs::default(), BTreeMap::new());
            for step in 0..120 {
                let (record, piece) = (random(2) as u8, random(12));
                match random(6) {
                    // A record or a part of one, in its order, its last piece shorter.
                    0 | 1 => {
                        let (whole, n) = (step as usize, 1 + random(8));
                        for place in 0..n {
                            let length = if place + 1 == n { 3 } else { 4 };
                            let value = Test::Part { whole, at: 4 * place, length };
                            let key = key(record, piece + place);
                            let before = pairs.insert(&key, value.clone());
                            assert_eq!(before, expected.insert(key, value));
                        }
                    }
                    2 => {
                        let (key, value) = (key(record, piece), Test::Alone(step));
                        let before = pairs.insert(&key, value.clone());
                        assert_eq!(before, expected.insert(key, value));
                    }
                    // A longer key between two pieces, or a shorter one before all.
                    3 => {
                        let mut key = key(record, piece);
                        if random(2) == 0 {
                            key.push(7)
                        } else {
                            key.truncate(2)
                        }
                        let value = Test::Part { whole: 1, at: 4 * random(3), length: 4 };
                        let before = pairs.insert(&key, value.clone());
                        assert_eq!(before, expected.insert(key, value));
                    }
                    _ => {
                        for piece in piece..piece + random(4) {
                            let key = key(record, piece);
                            assert_eq!(pairs.remove(&key), expected.remove(&key));
                        }
                    }
                }
                let mut probe = key(random(2) as u8, random(14));
                match random(4) {
                    0 => probe.push(7),
                    1 => probe.truncate(2),
                    _ => {}
                }
                compare(&pairs, &expected, &probe);
            }
        }
    }

    #[test]
    fn a_record_in_one_object_is_one_entry() {
        let mut pairs = Pairs::default();
        let mut set = |whole, pieces: std::ops::Range<u32>| {
            for (place, piece) in (0..).zip(pieces) {
                let value = Test::Part { whole, at: 4096 * place, length: 4096 };
                pairs.insert(&key(1, piece), value);
            }
            pairs.0.len()
        };
        assert_eq!(set(1, 1..129), 1);
        assert_eq!(set(2, 129..200), 2);
        // Numbers end.
        assert_eq!(set(3, u32::MAX - 1..u32::MAX), 3);
        pairs.remove(&key(1, 64));
        assert_eq!(pairs.0.len(), 4);
    }
}
