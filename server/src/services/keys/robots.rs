//! Names of robots: each belongs to the key that used it first, over the whole fleet.
//!
//! An administrator can give a name to another key, or release it. Revoking a key also
//! releases its names. An expired key keeps them.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::PoisonError;

use palpate_schemas as wire;
use palpate_store::error::StoreError;
use palpate_store::robot::RobotHolder;
use uuid::Uuid;

use super::Keys;
use super::error::KeyError;
use crate::cause::Cause;
use crate::clock::now_ms;
use crate::wire::reading::Incoming;
use crate::wire::{page_length, reading, time};

/// Maximum number of names of one key: more than robots, so that it cannot fill the store.
const NAMES_MAX: usize = 1000;

/// All names owned by keys.
pub(super) type Known = BTreeMap<String, RobotHolder>;

impl Keys {
    pub(super) fn read_robots(
        store: &palpate_store::database::Database,
    ) -> Result<Known, StoreError> {
        let all = store.robots().all()?;
        Ok(all.into_iter().map(|holder| (holder.robot.clone(), holder)).collect())
    }

    /// Claims the names of the robots of readings for a key: names without an owner become its own.
    pub(crate) async fn claim_robots(
        &self,
        key: Option<Uuid>,
        readings: &[Incoming],
    ) -> Result<(), KeyError> {
        let Some(key) = key else { return Ok(()) };
        let mut first: BTreeMap<&str, &str> = BTreeMap::new();
        for reading in readings {
            let Some(id) = &reading.id else { continue };
            first.entry(&id.robot).or_insert(&reading.pointer);
        }
        if self.unheld(key, &first)?.is_empty() {
            return Ok(());
        }
        let _alone = self.alone().await?;
        let new = self.unheld(key, &first)?;
        let held = self.robots(|robots| robots.values().filter(|it| it.key == key).count());
        if held + new.len() > NAMES_MAX {
            return Err(KeyError::RobotsFull { held, max: NAMES_MAX });
        }
        let since_ms = now_ms();
        let new: Vec<RobotHolder> =
            new.into_iter().map(|robot| RobotHolder { robot, key, since_ms }).collect();
        Ok(self.hold(new).await?)
    }

    /// The names without an owner; an error when one belongs to another key.
    fn unheld(
        &self,
        key: Uuid,
        names: &BTreeMap<&str, &str>,
    ) -> Result<BTreeSet<String>, KeyError> {
        let mut unheld = BTreeSet::new();
        for (name, pointer) in names {
            match self.robots(|robots| robots.get(*name).map(|holder| holder.key)) {
                Some(holder) if holder == key => {}
                Some(holder) if self.is_known(holder) => {
                    return Err(KeyError::RobotHeld {
                        pointer: format!("{pointer}/robot"),
                        robot: (*name).to_owned(),
                    });
                }
                Some(_) | None => drop(unheld.insert((*name).to_owned())),
            }
        }
        Ok(unheld)
    }

    /// A page of the names owned by keys.
    pub(crate) fn list_robots(&self, query: &wire::PageQuery) -> Result<wire::RobotPage, Cause> {
        let limit = page_length(query)?;
        let after = query.cursor.clone().unwrap_or_default();
        let mut behind = self.robots(|robots| {
            let behind = robots.values().filter(|holder| holder.robot > after);
            behind.take(limit + 1).cloned().collect::<Vec<_>>()
        });
        let more = behind.len() > limit;
        behind.truncate(limit);
        let next_cursor = behind.last().filter(|_| more).map(|holder| holder.robot.clone());
        let items = behind.into_iter().map(|holder| self.robot(holder)).collect();
        Ok(wire::RobotPage { items, next_cursor })
    }

    /// Assigns a robot's name to a key.
    pub(crate) async fn bind_robot(
        &self,
        robot: &str,
        request: &wire::BindRobot,
    ) -> Result<wire::Robot, KeyError> {
        reading::robot("?robot", robot)?;
        let _alone = self.alone().await?;
        let no_key = |_| Cause::field("/key", format!("there is no key {:?}", request.key));
        let key = self.get(&request.key).map_err(no_key)?;
        if key.revoked_at_ms.is_some() {
            return Err(KeyError::Refused { name: key.name });
        }
        let holder = RobotHolder { robot: robot.to_owned(), key: key.id, since_ms: now_ms() };
        self.hold(vec![holder.clone()]).await?;
        Ok(self.robot(holder))
    }

    /// Releases a robot's name: it belongs to the key that uses it next.
    pub(crate) async fn release_robot(&self, robot: &str) -> Result<(), Cause> {
        let _alone = self.alone().await?;
        if !self.robots(|robots| robots.contains_key(robot)) {
            return Err(Cause::unknown("robot", robot));
        }
        self.store.robots().remove(robot).await?;
        self.holders.write().unwrap_or_else(PoisonError::into_inner).remove(robot);
        Ok(())
    }

    /// The key that owns a robot's name.
    pub(crate) fn holder(&self, robot: &str) -> Option<Uuid> {
        self.robots(|robots| robots.get(robot).map(|holder| holder.key))
    }

    /// A key as the writer of something, for people.
    pub(crate) fn writer(&self, key: Uuid) -> wire::Writer {
        wire::Writer { key_id: key, key_name: self.find_id(key).map(|key| key.name) }
    }

    /// Stores names, then applies the change.
    async fn hold(&self, new: Vec<RobotHolder>) -> Result<(), StoreError> {
        self.store.robots().put(&new).await?;
        let mut holders = self.holders.write().unwrap_or_else(PoisonError::into_inner);
        holders.extend(new.into_iter().map(|holder| (holder.robot.clone(), holder)));
        Ok(())
    }

    fn robot(&self, holder: RobotHolder) -> wire::Robot {
        let RobotHolder { robot, key, since_ms } = holder;
        wire::Robot { name: robot, holder: self.writer(key), since: time(since_ms) }
    }

    /// Whether a key exists and is not revoked.
    fn is_known(&self, key: Uuid) -> bool {
        self.find_id(key).is_some_and(|key| key.revoked_at_ms.is_none())
    }

    fn robots<T>(&self, look: impl FnOnce(&Known) -> T) -> T {
        look(&self.holders.read().unwrap_or_else(PoisonError::into_inner))
    }
}
