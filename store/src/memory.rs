//! An engine in memory, for tests and trials; its data is lost with the process.

use std::collections::BTreeMap;
use std::ops::Bound;
use std::sync::Mutex;

use uuid::Uuid;

use crate::engine::content::ContentStats;
use crate::engine::{
    Commit, CommitError, Compacted, Cut, Engine, EngineError, EngineStats, Expected, Pair, Pending,
};
use crate::holding::{Bill, Held};

/// Keys and values in a sorted map under one lock.
#[derive(Debug, Default)]
pub struct MemoryEngine {
    state: Mutex<State>,
    held: Held,
}

#[derive(Debug, Default)]
struct State {
    pairs: BTreeMap<Vec<u8>, Vec<u8>>,
    commits: u64,
}

impl MemoryEngine {
    /// An empty engine.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    fn state(&self) -> std::sync::MutexGuard<'_, State> {
        self.state.lock().expect("no code panics while it holds this lock")
    }
}

impl Engine for MemoryEngine {
    fn get(&self, key: &[u8]) -> Result<Option<Vec<u8>>, EngineError> {
        Ok(self.state().pairs.get(key).cloned())
    }

    fn scan(
        &self,
        prefix: &[u8],
        after: Option<&[u8]>,
        limit: usize,
    ) -> Result<Vec<Pair>, EngineError> {
        let start = match after {
            Some(after) if after >= prefix => Bound::Excluded(after),
            _ => Bound::Included(prefix),
        };
        let state = self.state();
        let pairs = state.pairs.range::<[u8], _>((start, Bound::Unbounded));
        let within = pairs.take_while(|(key, _)| key.starts_with(prefix)).take(limit);
        Ok(within.map(|(key, value)| (key.clone(), value.clone())).collect())
    }

    fn commit(&self, commit: Commit) -> Pending {
        if let Err(error) = commit.check() {
            return Pending::ready(Err(error.into()));
        }
        let mut state = self.state();
        let broken = commit.expectations.iter().position(|(key, expected)| match expected {
            Expected::Absent => state.pairs.contains_key(key),
            Expected::Value(value) => state.pairs.get(key) != Some(value),
        });
        if let Some(expectation) = broken {
            return Pending::ready(Err(CommitError::Conflict { expectation }));
        }
        let mut bill = Bill::of(&commit);
        let mut writes: BTreeMap<Vec<u8>, Option<Vec<u8>>> = commit.writes.into_iter().collect();
        if let Some(bill) = &mut bill {
            for (key, value) in &writes {
                bill.add(key, state.pairs.get(key).map(Vec::len), value.as_ref().map(Vec::len));
            }
        }
        let get = |key: &[u8]| Ok(state.pairs.get(key).cloned());
        match bill.map_or(Ok(Vec::new()), |bill| bill.settle(&self.held, get)) {
            Ok(holdings) => writes.extend(holdings.into_iter().map(|(key, it)| (key, Some(it)))),
            Err(error) => return Pending::ready(Err(error.into())),
        }
        for (key, value) in writes {
            let before = state.pairs.get(&key).map(Vec::as_slice);
            if let Err(error) = self.held.note(&key, before, value.as_deref()) {
                return Pending::ready(Err(error.into()));
            }
            match value {
                Some(value) => state.pairs.insert(key, value),
                None => state.pairs.remove(&key),
            };
        }
        state.commits += 1;
        Pending::ready(Ok(()))
    }

    fn held(&self) -> BTreeMap<Uuid, u64> {
        self.held.all()
    }

    fn cut(&self) -> Result<Box<dyn Cut>, EngineError> {
        Ok(Box::new(MemoryCut(self.state().pairs.clone())))
    }

    fn compact(&self) -> Result<Compacted, EngineError> {
        let bytes = self.stats()?.bytes;
        Ok(Compacted { before_bytes: bytes, after_bytes: bytes, live_bytes: bytes })
    }

    fn stats(&self) -> Result<EngineStats, EngineError> {
        let state = self.state();
        let bytes = state.pairs.iter().map(|(key, value)| key.len() + value.len()).sum::<usize>();
        let commits = state.commits;
        Ok(EngineStats {
            engine: "memory",
            bytes: bytes as u64,
            live_bytes: bytes as u64,
            compactions: 0,
            free_bytes: None,
            reserve_bytes: 0,
            commits,
            flushes: 0,
            received_bytes: 0,
            content: ContentStats::default(),
        })
    }
}

/// The pairs that are still to be returned.
struct MemoryCut(BTreeMap<Vec<u8>, Vec<u8>>);

impl Cut for MemoryCut {
    fn next(&mut self, limit: usize) -> Result<Vec<Pair>, EngineError> {
        Ok(std::iter::from_fn(|| self.0.pop_first()).take(limit).collect())
    }
}
