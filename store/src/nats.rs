//! The engine on a cluster: NATS JetStream stores and replicates, any number of servers share it.
//!
//! One stream holds messages, each with the writes of a commit to one unit of keys (`unit`). A
//! follower applies them to an index of all keys (`index`), whose values lie in temporary local
//! files (`spool`): reads and scans are local. Large content that is written once is in objects of
//! a bucket beside the stream (`bucket`), and is fetched when it is read (`content`). A commit
//! publishes one message, or one atomic batch, that expects the last sequence of each unit
//! (`plan`); it is acknowledged when the stream has delivered it to this process, so that one's
//! own writes are seen. A reader may be behind the writes of other servers, a commit never.

mod message;
pub mod options;
mod unit;
mod bucket;
mod cache;
mod counts;
mod content;
mod pairs;
mod spool;
mod index;
mod plan;
mod lanes;
mod shared;
mod publish;
mod setup;
pub mod snapshots;
mod follow;
mod writer;
mod cut;
mod lease;
mod sweep;

use std::collections::BTreeMap;
use std::fmt;
use std::sync::atomic::Ordering;
use std::sync::mpsc::channel;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use futures::channel::oneshot;
use tokio::runtime::{Builder, Runtime};
use uuid::Uuid;

use crate::engine::content::ContentStats;
use crate::engine::lease::{Lease, Leasing};
use crate::engine::news::News;
use crate::engine::opening::OpenError;
use crate::engine::{
    Commit, CommitError, Compacted, Cut, Engine, EngineError, EngineStats, Pair, Pending, Reading,
};
use crate::key::Space;
use content::Contents;
use cut::NatsCut;
use index::{Index, read_all};
use lanes::{Admitted, Job, Lanes};
pub use options::NatsOptions;
use plan::Work;
use publish::Publisher;
use shared::Shared;
use spool::{Spool, Stored};
use sweep::Sweeper;

/// Maximum number of commits that run or wait.
const QUEUE_MAX: usize = 4096;
/// Number of threads that speak with the cluster.
const THREADS: usize = 2;
/// Time to finish commits when the engine is closed.
const CLOSE_WITHIN: Duration = Duration::from_secs(30);
/// Time to give the lease back.
const RELEASE_WITHIN: Duration = Duration::from_secs(2);
/// Garbage of a unit that a compaction leaves.
const SLACK_BYTES: u64 = 1024;
/// Number of units that one commit of a compaction writes.
const UNITS_PER_COMMIT: usize = 64;

/// A store on a cluster, opened.
pub struct NatsEngine {
    runtime: Option<Runtime>,
    desk: Arc<Desk>,
    has_lease: bool,
}

/// The parts of an open store.
struct Desk {
    publisher: Arc<Publisher>,
    shared: Arc<Shared>,
    contents: Arc<Contents>,
    sweeper: Arc<Sweeper>,
    lanes: Mutex<Lanes>,
    is_idle: Condvar,
}

impl fmt::Debug for NatsEngine {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("NatsEngine").field("stream", &self.desk.publisher.name).finish()
    }
}

impl NatsEngine {
    /// Opens the store on a cluster, made if it is missing. Blocks until all of it was followed.
    ///
    /// # Errors
    /// [`OpenError`] says what the cluster lacks.
    pub fn open(options: &NatsOptions) -> Result<Self, OpenError> {
        let runtime = Builder::new_multi_thread()
            .worker_threads(THREADS)
            .thread_name("nats")
            .enable_all()
            .build()
            .map_err(|source| OpenError::Thread { source })?;
        let spool = Spool::new(&options.spool)
            .map_err(|source| OpenError::Io { path: options.spool.clone(), source })?;
        let opened = runtime.block_on(async {
            let (publisher, bucket, last) = setup::open(options).await?;
            let cluster =
                |fault: String| OpenError::Cluster { servers: options.servers.join(","), fault };
            let publisher = Arc::new(publisher);
            let contents =
                Contents::new(bucket, options, runtime.handle().clone(), publisher.payload_max);
            let contents = Arc::new(contents);
            let shared = Arc::new(Shared::new(Index::new(spool, Arc::clone(&contents))));
            if !options.is_shared {
                let taken = lease::take(&publisher).await.map_err(cluster)?;
                let (publisher, shared) = (Arc::clone(&publisher), Arc::clone(&shared));
                tokio::spawn(async move { lease::keep(&publisher, shared, taken).await });
            }
            let (stream, client) = (publisher.stream.clone(), publisher.context.client());
            tokio::spawn(follow::follow(stream, client, Arc::clone(&shared)));
            shared.reach(last).await.map_err(|error| cluster(error.to_string()))?;
            let sweeper = Sweeper::new(
                Arc::clone(&publisher),
                Arc::clone(&shared),
                Arc::clone(&contents),
                options.removed_kept,
            );
            let sweeper = Arc::new(sweeper);
            tokio::spawn(Arc::clone(&sweeper).run());
            let (lanes, is_idle) = (Mutex::default(), Condvar::new());
            Ok(Desk { publisher, shared, contents, sweeper, lanes, is_idle })
        });
        let desk = match opened {
            Ok(desk) => Arc::new(desk),
            Err(error) => {
                runtime.shutdown_background();
                return Err(error);
            }
        };
        Ok(Self { runtime: Some(runtime), desk, has_lease: !options.is_shared })
    }

    fn submit(&self, work: Work) -> Pending {
        let (answer, pending) = Pending::channel();
        self.enter(Job { work, answer });
        pending
    }

    /// What the store has in objects of its bucket, and what became of it here.
    #[must_use]
    pub fn content(&self) -> ContentStats {
        self.desk.shared.index().content()
    }

    /// Removes content that nothing names any more. Blocks.
    fn sweep(&self) {
        let Some(runtime) = &self.runtime else { return };
        let (sweeper, (answer, done)) = (Arc::clone(&self.desk.sweeper), channel());
        runtime.spawn(async move {
            sweeper.remove_due().await;
            sweeper.compare_logged().await;
            // The one who waits is there as long as the engine.
            let _ = answer.send(());
        });
        // A closed engine sweeps no more.
        let _ = done.recv();
    }

    fn enter(&self, job: Job) {
        let mut lanes = self.desk.lanes();
        if lanes.len() >= QUEUE_MAX {
            return answer(job.answer, Err(EngineError::Busy { queue_max: QUEUE_MAX }.into()));
        }
        if let (Some(admitted), Some(runtime)) = (lanes.enter(job), &self.runtime) {
            runtime.spawn(run(Arc::clone(&self.desk), admitted));
        }
    }
}

impl Desk {
    fn lanes(&self) -> MutexGuard<'_, Lanes> {
        self.lanes.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Commits, answers, and lets those run that waited for it.
async fn run(desk: Arc<Desk>, admitted: Admitted) {
    let Desk { publisher, shared, contents, .. } = &*desk;
    let outcome = writer::commit(&admitted, publisher, shared, contents).await;
    let mut lanes = desk.lanes();
    for next in lanes.leave(&admitted.units) {
        tokio::spawn(run_boxed(Arc::clone(&desk), next));
    }
    if lanes.len() == 0 {
        desk.is_idle.notify_all();
    }
    drop(lanes);
    answer(admitted.job.answer, outcome);
}

/// As [`run`], of a type that does not contain itself.
fn run_boxed(
    desk: Arc<Desk>,
    admitted: Admitted,
) -> std::pin::Pin<Box<dyn Future<Output = ()> + Send>> {
    Box::pin(run(desk, admitted))
}

fn answer(answer: oneshot::Sender<Result<(), CommitError>>, outcome: Result<(), CommitError>) {
    // The receiver of a dropped `Pending` is gone; the commit stands.
    let _ = answer.send(outcome);
}

impl Engine for NatsEngine {
    fn get(&self, key: &[u8]) -> Result<Option<Vec<u8>>, EngineError> {
        self.desk.shared.check()?;
        let found = self.desk.shared.index().pairs.get(key);
        found.as_ref().map(Stored::read).transpose()
    }

    fn scan(
        &self,
        prefix: &[u8],
        after: Option<&[u8]>,
        limit: usize,
    ) -> Result<Vec<Pair>, EngineError> {
        self.desk.shared.check()?;
        let located = self.desk.shared.index().scan(prefix, after, limit);
        read_all(located)
    }

    fn keys(
        &self,
        prefix: &[u8],
        after: Option<&[u8]>,
        limit: usize,
    ) -> Result<Vec<Vec<u8>>, EngineError> {
        self.desk.shared.check()?;
        let located = self.desk.shared.index().scan(prefix, after, limit);
        Ok(located.into_iter().map(|(key, _)| key.to_vec()).collect())
    }

    fn commit(&self, commit: Commit) -> Pending {
        match commit.check().and_then(|()| self.desk.shared.check()) {
            Ok(()) => self.submit(Work { commit, compacts: Vec::new() }),
            Err(error) => Pending::ready(Err(error.into())),
        }
    }

    fn catch_up(&self) -> Reading {
        let (desk, (answer, done)) = (Arc::clone(&self.desk), oneshot::channel());
        if let Some(runtime) = &self.runtime {
            runtime.spawn(async move {
                // The asker may have gone.
                let _ = answer.send(writer::catch_up_all(&desk.publisher, &desk.shared).await);
            });
        }
        Box::pin(async move { done.await.unwrap_or(Err(EngineError::Stopped)) })
    }

    fn is_shared(&self) -> bool {
        !self.has_lease
    }

    fn news(&self, spaces: &[Space]) -> News {
        let news = News::of(spaces);
        self.desk.shared.hear(news.teller());
        news
    }

    fn lease(&self, name: &str) -> Leasing {
        // A process that has the whole store need not ask.
        let Some(runtime) = self.runtime.as_ref().filter(|_| self.is_shared()) else {
            return Box::pin(std::future::ready(Ok(Some(Lease::lasting()))));
        };
        let (publisher, name) = (Arc::clone(&self.desk.publisher), name.to_owned());
        let (answer, done) = oneshot::channel();
        runtime.spawn(async move {
            // One that nobody awaits is given back.
            let _ = answer.send(lease::take_named(publisher, &name).await);
        });
        Box::pin(async move { done.await.unwrap_or(Err(EngineError::Stopped)) })
    }

    fn held(&self) -> BTreeMap<Uuid, u64> {
        self.desk.shared.index().held.all()
    }

    fn cut(&self) -> Result<Box<dyn Cut>, EngineError> {
        self.desk.shared.check()?;
        Ok(Box::new(NatsCut::new(self.desk.shared.index().pairs.entries())))
    }

    fn compact(&self) -> Result<Compacted, EngineError> {
        let before_bytes = self.stats()?.bytes;
        let is_worth = |state: &index::UnitState| {
            state.n_keys > 0 && state.logged_bytes > 2 * state.message_bytes + SLACK_BYTES
        };
        let units: Vec<Vec<u8>> = {
            let index = self.desk.shared.index();
            let worth = index.units.iter().filter(|(_, state)| is_worth(state));
            worth.map(|(id, _)| id.clone()).collect()
        };
        for group in units.chunks(UNITS_PER_COMMIT) {
            let work = Work { commit: Commit::new(), compacts: group.to_vec() };
            self.submit(work).wait().map_err(|error| match error {
                CommitError::Engine(error) => error,
                CommitError::Conflict { .. } => unreachable!("the commit expects nothing"),
            })?;
        }
        self.sweep();
        self.desk.shared.compactions.fetch_add(1, Ordering::Relaxed);
        let EngineStats { bytes: after_bytes, live_bytes, .. } = self.stats()?;
        Ok(Compacted { before_bytes, after_bytes, live_bytes })
    }

    fn stats(&self) -> Result<EngineStats, EngineError> {
        self.desk.shared.check()?;
        let shared = &self.desk.shared;
        let index = shared.index();
        Ok(EngineStats {
            engine: "nats",
            bytes: index.logged_bytes + index.content_bytes,
            live_bytes: index.live_bytes,
            compactions: shared.compactions.load(Ordering::Relaxed),
            free_bytes: None,
            reserve_bytes: 0,
            commits: shared.commits.load(Ordering::Relaxed),
            flushes: shared.batches.load(Ordering::Relaxed),
            received_bytes: self.desk.publisher.received_bytes(),
            content: index.content(),
        })
    }
}

impl Drop for NatsEngine {
    fn drop(&mut self) {
        // A dropped `Pending` does not undo its commit.
        let lanes = self.desk.lanes();
        let waiting =
            self.desk.is_idle.wait_timeout_while(lanes, CLOSE_WITHIN, |lanes| lanes.len() > 0);
        if waiting.is_ok_and(|(_, timeout)| timeout.timed_out()) {
            tracing::warn!("The store was closed before all its commits were answered");
        }
        let Some(runtime) = self.runtime.take() else { return };
        if self.has_lease {
            let (publisher, (answer, done)) = (Arc::clone(&self.desk.publisher), channel());
            runtime.spawn(async move {
                lease::release(&publisher).await;
                // The receiver is gone after `RELEASE_WITHIN`.
                let _ = answer.send(());
            });
            // It expires by itself otherwise.
            let _ = done.recv_timeout(RELEASE_WITHIN);
        }
        runtime.shutdown_background();
    }
}
