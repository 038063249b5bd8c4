//! Tables of items by id, some also by a unique name: create, get, list, update, remove.
//!
//! Every change is one commit with compare-and-swap: names stay unique and no update is lost
//! under concurrent writes.

use std::marker::PhantomData;
use std::sync::Arc;

use uuid::Uuid;

use crate::engine::{self, Commit, Engine, Expected};
use crate::entity::{Job, Object, Sensor, Session};
use crate::envelope;
use crate::error::{StoreError, conflict};
use crate::key::{self, ID_KEY_BYTES, Space};
use crate::pieces::{self, Limit};
use crate::record::{self, NameV1, Record};

/// Attempts of an update under concurrent changes.
const UPDATE_ATTEMPTS: usize = 64;

/// Number of keys per read.
const KEYS_PER_SCAN: usize = 256;

/// Number of items that one page of a search looks at. Chosen: tens of milliseconds; `next` goes on.
pub const LOOKED_AT_MAX: usize = 10_000;

/// An item of a [`Table`].
pub trait Entity: Record + Clone + Send + Sync {
    /// Space of its records.
    const SPACE: Space;
    /// Its kind, in messages.
    const WHAT: &'static str;

    /// Its id.
    fn id(&self) -> Uuid;

    /// Its name, unique among its kind, if its kind has names.
    fn name(&self) -> Option<&str> {
        None
    }
}

/// A page of a table's items, in the order of their ids (which is that of their creation).
#[derive(Clone, Debug, PartialEq)]
pub struct Page<T> {
    /// The items.
    pub items: Vec<T>,
    /// Start of the next page, if there is more.
    pub next: Option<Uuid>,
}

/// All items of one kind.
#[derive(Clone)]
pub struct Table<T> {
    engine: Arc<dyn Engine>,
    kind: PhantomData<fn() -> T>,
}

impl<T: Entity> Table<T> {
    pub(crate) fn new(engine: Arc<dyn Engine>) -> Self {
        Self { engine, kind: PhantomData }
    }

    /// Stores a new item.
    ///
    /// # Errors
    /// [`StoreError::Exists`] and [`StoreError::NameTaken`]; the engine's.
    pub async fn create(&self, item: &T) -> Result<(), StoreError> {
        let head = key::id(T::SPACE, item.id());
        let mut commit = Commit::new().expect(head.clone(), Expected::Absent);
        if let Some(name) = item.name() {
            commit = name_commit::<T>(commit, name, item.id());
        }
        commit = pieces::put(commit, &head, &record::encode(item), None);
        match self.engine.commit(commit).await.map_err(conflict) {
            Ok(()) => Ok(()),
            Err(Ok(0)) => Err(StoreError::Exists { what: T::WHAT, id: item.id() }),
            Err(Ok(_)) => Err(name_taken::<T>(item)),
            Err(Err(error)) => Err(error.into()),
        }
    }

    /// The item with the given id, if any.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] and the engine's.
    pub fn find(&self, id: Uuid) -> Result<Option<T>, StoreError> {
        Ok(self.read(id)?.map(|(item, _)| item))
    }

    /// The item with the given id.
    ///
    /// # Errors
    /// [`StoreError::NotFound`]; otherwise as [`Table::find`].
    pub fn get(&self, id: Uuid) -> Result<T, StoreError> {
        self.find(id)?.ok_or(StoreError::NotFound { what: T::WHAT, id })
    }

    /// The item with the given name, if any.
    ///
    /// # Errors
    /// As [`Table::find`].
    pub fn find_by_name(&self, name: &str) -> Result<Option<T>, StoreError> {
        // No item has a name of this length, and no key can hold it.
        if name.len() > NAME_BYTES_MAX {
            return Ok(None);
        }
        let Some(bytes) = self.engine.get(&key::name(T::SPACE, name))? else { return Ok(None) };
        let named: NameV1 = record::decode(&bytes).map_err(StoreError::damaged(Space::Name))?;
        self.find(Uuid::from_bytes(named.id))
    }

    /// Up to `limit` items after `after` (a page's `next`).
    ///
    /// # Errors
    /// As [`Table::find`].
    pub fn list(&self, after: Option<Uuid>, limit: usize) -> Result<Page<T>, StoreError> {
        let prefix = key::space(T::SPACE);
        let after = after.map(behind::<T>);
        let wanted = limit.saturating_add(1);
        let records = pieces::scan(
            &*self.engine,
            T::SPACE,
            &prefix,
            ID_KEY_BYTES,
            after,
            Limit::records(wanted),
        )?;
        let decoded: Result<Vec<T>, _> =
            records.iter().map(|(_, record)| record::decode(record)).collect();
        let mut items = decoded.map_err(StoreError::damaged(T::SPACE))?;
        let more = items.len() > limit;
        items.truncate(limit);
        Ok(Page { next: items.last().filter(|_| more).map(Entity::id), items })
    }

    /// Like [`Table::list`], without damaged items, which are logged; [`Table::get`] returns
    /// their fault.
    ///
    /// # Errors
    /// The engine's.
    pub fn list_whole(&self, after: Option<Uuid>, limit: usize) -> Result<Page<T>, StoreError> {
        let prefix = key::space(T::SPACE);
        let (mut items, mut last) = (Vec::new(), after);
        let heads = self.heads(&prefix, after, limit.saturating_add(1))?;
        let more = heads.len() > limit;
        for (id, first) in heads.into_iter().take(limit) {
            last = Some(id);
            let is_whole = envelope::total_bytes(&first).is_ok_and(|total| total == first.len());
            let found = match is_whole {
                true => record::decode(&first).map(Some).map_err(StoreError::damaged(T::SPACE)),
                false => self.find(id),
            };
            match found {
                Ok(found) => items.extend(found),
                Err(error @ StoreError::Damaged { .. }) => {
                    tracing::error!("Left {} {id} out of a list: {error}", T::WHAT);
                }
                Err(error) => return Err(error),
            }
        }
        Ok(Page { next: last.filter(|_| more), items })
    }

    /// Like [`Table::list_whole`], only items that fit. Looks at [`LOOKED_AT_MAX`] items at most,
    /// so a page may be short, even empty, and have a next one.
    ///
    /// # Errors
    /// The engine's.
    pub fn list_fitting(
        &self,
        after: Option<Uuid>,
        limit: usize,
        fits: impl Fn(&T) -> bool,
    ) -> Result<Page<T>, StoreError> {
        let (mut items, mut after, mut n_looked_at) = (Vec::new(), after, 0);
        loop {
            let page = self.list_whole(after, KEYS_PER_SCAN)?;
            let last = page.items.last().map(T::id);
            n_looked_at += page.items.len();
            for item in page.items.into_iter().filter(|item| fits(item)) {
                items.push(item);
                if items.len() == limit {
                    let full = items.last().map(T::id);
                    let next = full.filter(|full| page.next.is_some() || last != Some(*full));
                    return Ok(Page { items, next });
                }
            }
            after = page.next;
            if after.is_none() || n_looked_at >= LOOKED_AT_MAX {
                return Ok(Page { items, next: after });
            }
        }
    }

    /// Up to `limit` ids after `after`, in ascending order, with the first piece of each record.
    fn heads(
        &self,
        prefix: &[u8],
        after: Option<Uuid>,
        limit: usize,
    ) -> Result<Vec<(Uuid, Vec<u8>)>, StoreError> {
        let mut found = Vec::new();
        let mut pages = engine::pages(&*self.engine, prefix, after.map(behind::<T>), KEYS_PER_SCAN);
        while found.len() < limit
            && let Some(page) = pages.next().transpose()?
        {
            let heads = page.into_iter().filter(|(key, _)| key.len() == ID_KEY_BYTES);
            found.extend(
                heads.filter_map(|(key, first)| Some((Uuid::from_slice(&key[1..]).ok()?, first))),
            );
        }
        found.truncate(limit);
        Ok(found)
    }

    /// All items.
    ///
    /// # Errors
    /// As [`Table::find`].
    pub fn all(&self) -> Result<Vec<T>, StoreError> {
        Ok(self.list(None, usize::MAX - 1)?.items)
    }

    /// Changes an item under concurrent changes: `change` may run several times, each time on
    /// the newest state. If it returns an error, nothing is stored.
    ///
    /// # Errors
    /// Outside: the store's ([`StoreError::NotFound`], [`StoreError::NameTaken`] after a rename).
    /// Inside: the error of `change`.
    pub async fn update<R>(
        &self,
        id: Uuid,
        mut change: impl FnMut(&mut T) -> Result<(), R>,
    ) -> Result<Result<T, R>, StoreError> {
        self.update_with(id, |item| change(item).map(|()| Commit::new())).await
    }

    /// Like [`Table::update`]; the writes returned by `change` are applied with the change or
    /// not at all.
    pub(crate) async fn update_with<R>(
        &self,
        id: Uuid,
        mut change: impl FnMut(&mut T) -> Result<Commit, R>,
    ) -> Result<Result<T, R>, StoreError> {
        for _ in 0..UPDATE_ATTEMPTS {
            let found = self.read(id)?;
            let (before, bytes) = found.ok_or(StoreError::NotFound { what: T::WHAT, id })?;
            let mut after = before.clone();
            let with = match change(&mut after) {
                Ok(with) => with,
                Err(refusal) => return Ok(Err(refusal)),
            };
            let head = key::id(T::SPACE, id);
            let mut commit =
                Commit::new().expect(head.clone(), Expected::Value(pieces::first(&bytes)));
            commit.writes.extend(with.writes);
            commit.counted = with.counted;
            if let (Some(old), Some(new)) = (before.name(), after.name())
                && old != new
            {
                commit = name_commit::<T>(commit.remove(key::name(T::SPACE, old)), new, id);
            }
            commit = pieces::put(commit, &head, &record::encode(&after), Some(&bytes));
            match self.engine.commit(commit).await.map_err(conflict) {
                Ok(()) => return Ok(Ok(after)),
                Err(Ok(0)) => {}
                Err(Ok(_)) => return Err(name_taken::<T>(&after)),
                Err(Err(error)) => return Err(error.into()),
            }
        }
        Err(StoreError::Changed { what: T::WHAT, id })
    }

    /// Removes an item and its name; `false` when there was none.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] and the engine's.
    pub async fn remove(&self, id: Uuid) -> Result<bool, StoreError> {
        for _ in 0..UPDATE_ATTEMPTS {
            let Some((item, bytes)) = self.read(id)? else { return Ok(false) };
            let head = key::id(T::SPACE, id);
            let mut commit =
                Commit::new().expect(head.clone(), Expected::Value(pieces::first(&bytes)));
            if let Some(name) = item.name() {
                commit = commit.remove(key::name(T::SPACE, name));
            }
            match self.engine.commit(pieces::remove(commit, &head, &bytes)).await.map_err(conflict)
            {
                Ok(()) => return Ok(true),
                Err(Ok(_)) => {}
                Err(Err(error)) => return Err(error.into()),
            }
        }
        Err(StoreError::Changed { what: T::WHAT, id })
    }

    fn read(&self, id: Uuid) -> Result<Option<(T, Vec<u8>)>, StoreError> {
        let head = key::id(T::SPACE, id);
        let Some(bytes) = pieces::read(&*self.engine, T::SPACE, &head)? else { return Ok(None) };
        let item = record::decode(&bytes).map_err(StoreError::damaged(T::SPACE))?;
        Ok(Some((item, bytes)))
    }
}

/// Maximum length of a name, bytes.
pub const NAME_BYTES_MAX: usize = 200;

/// A key after all pieces of an item, and before the next item.
fn behind<T: Entity>(id: Uuid) -> Vec<u8> {
    [&key::id(T::SPACE, id)[..], &[0xff; 5]].concat()
}

fn name_commit<T: Entity>(commit: Commit, name: &str, id: Uuid) -> Commit {
    let key = key::name(T::SPACE, name);
    let named = record::encode(&NameV1 { id: id.into_bytes() });
    commit.expect(key.clone(), Expected::Absent).put(key, named)
}

fn name_taken<T: Entity>(item: &T) -> StoreError {
    StoreError::NameTaken { what: T::WHAT, name: item.name().unwrap_or_default().to_owned() }
}

impl Entity for Sensor {
    const SPACE: Space = Space::Sensor;
    const WHAT: &'static str = "sensor";

    fn id(&self) -> Uuid {
        self.id
    }

    fn name(&self) -> Option<&str> {
        Some(&self.name)
    }
}

impl Entity for Object {
    const SPACE: Space = Space::Object;
    const WHAT: &'static str = "object";

    fn id(&self) -> Uuid {
        self.id
    }

    fn name(&self) -> Option<&str> {
        Some(&self.name)
    }
}

impl Entity for Job {
    const SPACE: Space = Space::Job;
    const WHAT: &'static str = "job";

    fn id(&self) -> Uuid {
        self.id
    }
}

impl Entity for Session {
    const SPACE: Space = Space::Session;
    const WHAT: &'static str = "session";

    fn id(&self) -> Uuid {
        self.id
    }
}
