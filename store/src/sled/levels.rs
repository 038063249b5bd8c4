//! The levels: the sled that is written to, over a frozen one, over a base.
//!
//! The uppermost level that knows a key has its value; "removed" in a level hides the key
//! below. Only the top changes. A reader holds an [`Arc`] of the levels for one operation.
//! The levels are replaced between two commits by others with the same content.

use std::cmp::Ordering;
use std::io;
use std::ops::Bound;
use std::path::PathBuf;
use std::sync::Arc;

use super::base::Base;
use super::tally::TALLY_KEY;
use crate::engine::Pair;

/// First byte of a stored value, where a level below may have the key too.
const VALUE: u8 = 1;
/// Stored form of a removed key there.
const REMOVED: [u8; 1] = [0];

/// A sled, and the form of its values.
#[derive(Clone, Debug)]
pub(super) struct Layer {
    pub(super) db: ::sled::Db,
    pub(super) folder: PathBuf,
    pub(super) form: Form,
}

/// Form of a sled's values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Form {
    /// Unchanged: no level is ever below it.
    Plain,
    /// After a byte that says whether the key was removed.
    Tagged,
}

impl Form {
    /// The form of a sled by its number; number 0 is older than compactions.
    pub(super) fn of(number: u64) -> Self {
        if number == 0 { Self::Plain } else { Self::Tagged }
    }

    /// The stored form of a value.
    pub(super) fn encode(self, value: Vec<u8>) -> Vec<u8> {
        match self {
            Self::Plain => value,
            Self::Tagged => [&[VALUE][..], &value].concat(),
        }
    }

    /// The value, `None` for a removed key.
    fn decode(self, stored: &[u8]) -> ::sled::Result<Option<Vec<u8>>> {
        match (self, stored.split_first()) {
            (Self::Plain, _) => Ok(Some(stored.to_vec())),
            (Self::Tagged, Some((&VALUE, value))) => Ok(Some(value.to_vec())),
            (Self::Tagged, _) if stored == REMOVED => Ok(None),
            (Self::Tagged, _) => {
                let what = "a value begins with a byte that means nothing";
                Err(::sled::Error::Io(io::Error::new(io::ErrorKind::InvalidData, what)))
            }
        }
    }
}

/// A key, and its value unless it was removed.
pub(super) type LevelEntry = (Vec<u8>, Option<Vec<u8>>);
type LevelEntries = Box<dyn Iterator<Item = ::sled::Result<LevelEntry>>>;

impl Layer {
    /// This level's entry for a key; `None` if it has none.
    pub(super) fn get(&self, key: &[u8]) -> ::sled::Result<Option<Option<Vec<u8>>>> {
        self.db.get(key)?.map(|stored| self.form.decode(&stored)).transpose()
    }

    fn range(&self, start: Bound<&[u8]>) -> LevelEntries {
        let form = self.form;
        Box::new(self.db.range::<&[u8], _>((start, Bound::Unbounded)).map(move |pair| {
            let (key, stored) = pair?;
            Ok((key.to_vec(), form.decode(&stored)?))
        }))
    }
}

/// The levels of a database at one time.
#[derive(Clone, Debug)]
pub(super) struct Levels {
    pub(super) top: Layer,
    pub(super) frozen: Option<Layer>,
    pub(super) base: Option<Arc<Base>>,
}

impl Levels {
    /// The value of a key.
    pub(super) fn get(&self, key: &[u8]) -> ::sled::Result<Option<Vec<u8>>> {
        match self.top.get(key)? {
            Some(value) => Ok(value),
            None => self.get_below(key),
        }
    }

    /// The value of a key in the levels below the top.
    pub(super) fn get_below(&self, key: &[u8]) -> ::sled::Result<Option<Vec<u8>>> {
        if let Some(frozen) = &self.frozen
            && let Some(value) = frozen.get(key)?
        {
            return Ok(value);
        }
        let found = self.base.as_ref().map(|base| base.get(key)).transpose()?;
        Ok(found.flatten())
    }

    /// The pairs from `start` on, in ascending order, without the tally.
    pub(super) fn range(&self, start: Bound<&[u8]>) -> Merged {
        let sleds = std::iter::once(&self.top).chain(&self.frozen).map(|layer| layer.range(start));
        let base = self.base.iter().map(|base| -> LevelEntries {
            Box::new(base.range(start).map(|pair| {
                let (key, value) = pair?;
                Ok((key, Some(value)))
            }))
        });
        Merged { sources: sleds.chain(base).map(Iterator::peekable).collect() }
    }

    /// The writes and removals in the sleds from `start` on, by ascending key; the upper sled wins.
    pub(super) fn changes(
        &self,
        start: Bound<&[u8]>,
    ) -> impl Iterator<Item = ::sled::Result<LevelEntry>> + use<> {
        let sleds = std::iter::once(&self.top).chain(&self.frozen).map(|layer| layer.range(start));
        let mut merged = Merged { sources: sleds.map(Iterator::peekable).collect() };
        std::iter::from_fn(move || merged.next_entry())
    }

    /// Adds a write to the batch of the top; `None` removes.
    ///
    /// A removed key leaves an entry only if a level below has it: records that come and go
    /// between two compactions leave none.
    pub(super) fn write(
        &self,
        batch: &mut ::sled::Batch,
        key: Vec<u8>,
        value: Option<Vec<u8>>,
    ) -> ::sled::Result<()> {
        match value {
            Some(value) => batch.insert(key, self.top.form.encode(value)),
            None if self.get_below(&key)?.is_some() => batch.insert(key, &REMOVED),
            None => batch.remove(key),
        }
        Ok(())
    }
}

/// The pairs of all levels, the uppermost for each key.
pub(super) struct Merged {
    /// From the top down.
    sources: Vec<std::iter::Peekable<LevelEntries>>,
}

impl Merged {
    fn next_entry(&mut self) -> Option<::sled::Result<LevelEntry>> {
        if let [only] = self.sources.as_mut_slice() {
            return only.next();
        }
        let mut least: Option<(usize, Vec<u8>)> = None;
        let mut hidden = Vec::new();
        for place in 0..self.sources.len() {
            let key = match self.sources[place].peek() {
                Some(Ok((key, _))) => key,
                Some(Err(_)) => return self.sources[place].next(),
                None => continue,
            };
            match least.as_ref().map_or(Ordering::Less, |(_, least)| key.cmp(least)) {
                Ordering::Less => {
                    hidden.clear();
                    least = Some((place, key.clone()));
                }
                Ordering::Equal => hidden.push(place),
                Ordering::Greater => {}
            }
        }
        let (place, _) = least?;
        for place in hidden {
            self.sources[place].next();
        }
        self.sources[place].next()
    }
}

impl Iterator for Merged {
    type Item = ::sled::Result<Pair>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            match self.next_entry()? {
                Ok((_, None)) => {}
                Ok((key, _)) if key == TALLY_KEY => {}
                Ok((key, Some(value))) => return Some(Ok((key, value))),
                Err(error) => return Some(Err(error)),
            }
        }
    }
}
