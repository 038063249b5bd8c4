//! An engine whose commits may use the reserve of a full disk, for operations that must
//! always work: revoking a key, ending a session, freeing space.

use std::collections::BTreeMap;
use std::sync::Arc;

use uuid::Uuid;

use crate::engine::{Commit, Compacted, Cut, Engine, EngineError, EngineStats, Pair, Pending};

/// Marks all commits to the engine as essential.
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
