//! News: which records other processes changed, for what this process keeps in memory.
//!
//! News name records, not what became of them: a reader looks into the store. Changes of one
//! record are told once until they are read. A reader that is too far behind is told that
//! everything may have changed.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

use tokio::sync::Notify;
use uuid::Uuid;

use crate::key::Space;

/// Number of unread changes above which everything may have changed. Chosen: a few megabytes.
const UNREAD_MAX: usize = 50_000;

/// A record that another process wrote or removed.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Changed {
    /// The record of an id.
    Id(u8, Uuid),
    /// A record with a number, such as an entry of the audit log.
    Number(u8, u64),
    /// A record of an id under an id.
    Nested(u8, Uuid, Uuid),
    /// A record with a number under an id.
    Numbered(u8, Uuid, u64),
    /// A record with a name.
    Name(u8, String),
}

impl Changed {
    /// What the key of a record says; `None` for keys of no such form.
    fn of(key: &[u8]) -> Option<Self> {
        let (&space, rest) = key.split_first()?;
        let id = |bytes: &[u8]| Uuid::from_slice(bytes).ok();
        match rest.len() {
            _ if space == Space::RobotHolder as u8 => {
                Some(Self::Name(space, String::from_utf8(rest.to_vec()).ok()?))
            }
            8 => Some(Self::Number(space, u64::from_be_bytes(rest.try_into().ok()?))),
            16 => Some(Self::Id(space, id(rest)?)),
            24 => {
                let number = u64::from_be_bytes(rest[16..].try_into().ok()?);
                Some(Self::Numbered(space, id(&rest[..16])?, number))
            }
            32 => Some(Self::Nested(space, id(&rest[..16])?, id(&rest[16..])?)),
            _ => None,
        }
    }
}

/// What was not read yet.
#[derive(Debug, Default)]
struct Unread {
    changed: BTreeSet<Changed>,
    /// Whether some changes were left out.
    is_more: bool,
}

#[derive(Debug)]
struct Board {
    spaces: Vec<u8>,
    unread: Mutex<Unread>,
    wake: Notify,
}

impl Board {
    fn unread(&self) -> MutexGuard<'_, Unread> {
        self.unread.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The news of an engine for one reader.
#[derive(Debug)]
pub struct News(Arc<Board>);

/// Changes since the last look.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Since {
    /// These.
    These(BTreeSet<Changed>),
    /// Any: too many to name.
    Everything,
}

impl News {
    /// News of spaces, as long as nobody tells any.
    #[must_use]
    pub fn of(spaces: &[Space]) -> Self {
        let spaces = spaces.iter().map(|space| *space as u8).collect();
        Self(Arc::new(Board { spaces, unread: Mutex::default(), wake: Notify::new() }))
    }

    /// Waits for changes and takes them.
    pub async fn next(&self) -> Since {
        loop {
            let told = self.0.wake.notified();
            {
                let mut unread = self.0.unread();
                let Unread { changed, is_more } = std::mem::take(&mut *unread);
                if is_more {
                    return Since::Everything;
                }
                if !changed.is_empty() {
                    return Since::These(changed);
                }
            }
            told.await;
        }
    }

    /// The end that tells.
    pub(crate) fn teller(&self) -> Teller {
        Teller(Arc::downgrade(&self.0))
    }
}

/// The end of [`News`] that an engine has.
#[derive(Debug)]
pub(crate) struct Teller(Weak<Board>);

impl Teller {
    /// Tells of a record by its key; `false` when nobody reads any more.
    pub(crate) fn tell(&self, key: &[u8]) -> bool {
        let Some(board) = self.0.upgrade() else { return false };
        let is_wanted = key.first().is_some_and(|space| board.spaces.contains(space));
        let Some(changed) = is_wanted.then(|| Changed::of(key)).flatten() else { return true };
        let mut unread = board.unread();
        if unread.changed.len() >= UNREAD_MAX {
            *unread = Unread { changed: BTreeSet::new(), is_more: true };
        }
        if !unread.is_more {
            unread.changed.insert(changed);
        }
        drop(unread);
        board.wake.notify_one();
        true
    }
}

#[cfg(test)]
mod tests {
    use futures::FutureExt;

    use super::*;
    use crate::key;

    #[test]
    fn changes_of_wanted_spaces_are_told_once() {
        let news = News::of(&[Space::AccessKey, Space::Delivery, Space::RobotHolder]);
        let teller = news.teller();
        let [one, two] = [1, 2].map(Uuid::from_u128);
        for key in [
            key::id(Space::AccessKey, one),
            key::id(Space::Session, one),
            key::nested(Space::Delivery, one, two),
            key::id(Space::AccessKey, one),
            key::robot_name("arm"),
        ] {
            assert!(teller.tell(&key));
        }
        let told = news.next().now_or_never();
        let expected = [
            Changed::Id(b'a', one),
            Changed::Nested(b'D', one, two),
            Changed::Name(b'h', "arm".to_owned()),
        ];
        assert_eq!(told, Some(Since::These(expected.into())));
        assert_eq!(news.next().now_or_never(), None);
        drop(news);
        assert!(!teller.tell(b"a"));
    }

    #[test]
    fn a_reader_far_behind_hears_that_all_may_have_changed() {
        let news = News::of(&[Space::Audit]);
        let teller = news.teller();
        for number in 0..=UNREAD_MAX as u64 {
            teller.tell(&[&[b'l'][..], &number.to_be_bytes()].concat());
        }
        assert_eq!(news.next().now_or_never(), Some(Since::Everything));
        teller.tell(&[&[b'l'][..], &7u64.to_be_bytes()].concat());
        let told = news.next().now_or_never();
        assert_eq!(told, Some(Since::These([Changed::Number(b'l', 7)].into())));
    }
}
