//! Names of robots and the API keys that own them, over the whole fleet.
//!
//! A name that no key has used has no record. Changes are one commit each; the server decides
//! who may make them.

mod stored;

use std::sync::Arc;

use uuid::Uuid;

use crate::engine::{self, Commit, Engine};
use crate::error::{StoreError, unconditional};
use crate::holding;
use crate::key::{self, Space};
use crate::record;

/// Number of records per read.
const RECORDS_PER_SCAN: usize = 1024;

/// A robot's name and the key that owns it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RobotHolder {
    /// The name.
    pub robot: String,
    /// The key's id.
    pub key: Uuid,
    /// Time since which the key owns it.
    pub since_ms: u64,
}

/// The names of all robots.
#[derive(Clone)]
pub struct RobotHolders {
    engine: Arc<dyn Engine>,
}

impl RobotHolders {
    pub(crate) fn new(engine: Arc<dyn Engine>) -> Self {
        Self { engine }
    }

    /// All names, in the order of their bytes. Blocks.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] and the engine's.
    pub fn all(&self) -> Result<Vec<RobotHolder>, StoreError> {
        let prefix = key::space(Space::RobotHolder);
        let mut found = Vec::new();
        for page in engine::pages(&*self.engine, &prefix, None, RECORDS_PER_SCAN) {
            for (_, bytes) in &page? {
                let holder = record::decode(bytes);
                found.push(holder.map_err(StoreError::damaged(Space::RobotHolder))?);
            }
        }
        Ok(found)
    }

    /// The owner of a name, if any.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] and the engine's.
    pub fn find(&self, robot: &str) -> Result<Option<RobotHolder>, StoreError> {
        let found = self.engine.get(&key::robot_name(robot))?;
        let holder = found.map(|bytes| record::decode(&bytes)).transpose();
        holder.map_err(StoreError::damaged(Space::RobotHolder))
    }

    /// Assigns names to keys, replacing earlier owners; durable when it returns.
    ///
    /// # Errors
    /// The engine's.
    pub async fn put(&self, holders: &[RobotHolder]) -> Result<(), StoreError> {
        let commit = holders.iter().fold(Commit::new(), |commit, holder| {
            commit.put(key::robot_name(&holder.robot), record::encode(holder))
        });
        Ok(self.engine.commit(commit).await.map_err(unconditional)?)
    }

    /// Releases a name; durable when it returns.
    ///
    /// # Errors
    /// The engine's.
    pub async fn remove(&self, robot: &str) -> Result<(), StoreError> {
        let commit = Commit::new().remove(key::robot_name(robot));
        self.engine.commit(commit).await.map_err(unconditional)?;
        Ok(holding::release(&*self.engine, &holding::robot(robot.as_bytes())).await?)
    }
}
