//! An engine whose commits may use the room that is kept for what must work on a full disk:
//! revoking a key, ending a session, removing what takes room.

use std::collections::BTreeMap;
use std::sync::Arc;

use uuid::Uuid;

use crate::engine::{Commit, Compacted, Cut, Engine, EngineError, EngineStats, Pair, Pending};

/// The engine behind it, all of whose commits are essential.
pub(crate) struct Essential(pub(crate) Arc<dyn Engine>);

impl Engine for Essential {
    fn get(&self, key: &[u8]) -> Result<Option<Vec<u8>>, EngineError> {
        self.0.get(key)
    }

    fn scan(
        &self,
        prefix: &[u8],
        after: Option<&[u8]>,
        limit: usize,
    ) -> Result<Vec<Pair>, EngineError> {
        self.0.scan(prefix, after, limit)
    }

    fn commit(&self, commit: Commit) -> Pending {
        self.0.commit(Commit { is_essential: true, ..commit })
    }

    fn held(&self) -> BTreeMap<Uuid, u64> {
        self.0.held()
    }

    fn cut(&self) -> Result<Box<dyn Cut>, EngineError> {
        self.0.cut()
    }

    fn compact(&self) -> Result<Compacted, EngineError> {
        self.0.compact()
    }

    fn stats(&self) -> Result<EngineStats, EngineError> {
        self.0.stats()
    }
}
