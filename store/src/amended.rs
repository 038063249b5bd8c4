//! An engine that states for each commit whom it counts towards and how urgent it is.
//!
//! Essential commits may use the reserve of a full disk. They are those of operations that must
//! always work: revoking a key, ending a session, freeing space.

use std::collections::BTreeMap;
use std::sync::Arc;

use uuid::Uuid;

use crate::engine::lease::Leasing;
use crate::engine::news::News;
use crate::engine::{
    Commit, Compacted, Cut, Engine, EngineError, EngineStats, Pair, Pending, Reading,
};
use crate::holding::{Held, Who};
use crate::key::Space;

/// Amends the commits to an engine.
pub(crate) struct Amended {
    engine: Arc<dyn Engine>,
    /// Source of the account of each commit.
    who: Option<Who>,
    is_essential: bool,
}

impl Amended {
    /// All commits are essential.
    pub(crate) fn essential(engine: Arc<dyn Engine>) -> Self {
        Self { engine, who: None, is_essential: true }
    }

    /// Each commit counts towards the account that `who` names at the time.
    pub(crate) fn accounted(engine: Arc<dyn Engine>, who: Who) -> Self {
        Self { engine, who: Some(who), is_essential: false }
    }
}

impl Engine for Amended {
    fn get(&self, key: &[u8]) -> Result<Option<Vec<u8>>, EngineError> {
        self.engine.get(key)
    }

    fn scan(
        &self,
        prefix: &[u8],
        after: Option<&[u8]>,
        limit: usize,
    ) -> Result<Vec<Pair>, EngineError> {
        self.engine.scan(prefix, after, limit)
    }

    fn keys(
        &self,
        prefix: &[u8],
        after: Option<&[u8]>,
        limit: usize,
    ) -> Result<Vec<Vec<u8>>, EngineError> {
        self.engine.keys(prefix, after, limit)
    }

    fn commit(&self, mut commit: Commit) -> Pending {
        commit.is_essential |= self.is_essential;
        if let Some(who) = &self.who {
            commit.account = who();
        }
        self.engine.commit(commit)
    }

    fn catch_up(&self) -> Reading {
        self.engine.catch_up()
    }

    fn is_shared(&self) -> bool {
        self.engine.is_shared()
    }

    fn news(&self, spaces: &[Space]) -> News {
        self.engine.news(spaces)
    }

    fn lease(&self, name: &str) -> Leasing {
        self.engine.lease(name)
    }

    fn held(&self) -> BTreeMap<Uuid, u64> {
        self.engine.held()
    }

    fn check_quota(&self, more: u64) -> Result<(), EngineError> {
        let account = self.who.as_ref().and_then(|who| who());
        account.map_or(Ok(()), |account| Held::of(&*self.engine).check(account, more))
    }

    fn cut(&self) -> Result<Box<dyn Cut>, EngineError> {
        self.engine.cut()
    }

    fn compact(&self) -> Result<Compacted, EngineError> {
        self.engine.compact()
    }

    fn stats(&self) -> Result<EngineStats, EngineError> {
        self.engine.stats()
    }
}
