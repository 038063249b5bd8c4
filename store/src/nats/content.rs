//! Content: values in objects of the bucket, put before a message names them and fetched when
//! they are read first.
//!
//! A value's place in an object is known from the stream; following the stream fetches nothing.
//! An object is checked against its hash, and kept in the cache (`cache`). Readers are
//! synchronous and may wait for a fetch, within a bound; the fetch runs on the engine's own
//! threads. Readers of one object fetch it once.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use tokio::runtime::{Handle, RuntimeFlavor};
use uuid::Uuid;

use super::bucket::{Bucket, GetFault};
use super::cache::{Cache, Kept, Perhaps};
use super::counts::Counts;
use super::message::{Described, ObjectId, Part};
use super::options::NatsOptions;
use super::unit;
use crate::engine::EngineError;
use crate::engine::content::ContentStats;

/// Largest object. Chosen: half of the default of NATS for a message, so that an object is one
/// chunk; and the read of one value of 4 KiB fetches no more.
const OBJECT_BYTES_MAX: usize = 512 << 10;
/// Time to fetch an object. Chosen: a leader's crash takes up to 9 s.
const FETCHED_WITHIN: Duration = Duration::from_secs(15);
/// Time after which an object that could not be put is given up, as commits are.
const PUT_WITHIN: Duration = Duration::from_secs(60);
/// Time after which a reader gives up if the fetch does not do so.
const SLACK: Duration = Duration::from_secs(5);
const PAUSE: Duration = Duration::from_millis(200);
const READING: &str = "reading large content";

/// The content of a store.
#[derive(Debug)]
pub(super) struct Contents {
    pub(super) bucket: Bucket,
    cache: Cache,
    runtime: Handle,
    /// Content of a unit in a commit from which on it is put.
    bytes_min: usize,
    /// Largest object, if messages of the cluster are shorter.
    object_bytes_max: usize,
    pub(super) counts: Counts,
}

/// The reason for which an object was not fetched.
enum FetchFault {
    Missing,
    Damaged { found: u64 },
    Unanswered(String),
    Cache(String),
}

/// An object that the stream names.
pub(super) struct Object {
    pub(super) described: Described,
    unit: Box<[u8]>,
    contents: Arc<Contents>,
    place: Mutex<Option<Perhaps>>,
    /// Whether no record names it any more.
    is_released: AtomicBool,
    /// Taken by the one who fetches.
    turn: tokio::sync::Mutex<()>,
}

impl fmt::Debug for Object {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("Object").field("described", &self.described).finish_non_exhaustive()
    }
}

impl Contents {
    /// The content in a bucket, with a cache in the folder of the spool; fetches run on `runtime`.
    pub(super) fn new(
        bucket: Bucket,
        options: &NatsOptions,
        runtime: Handle,
        payload_max: usize,
    ) -> Self {
        let (cache, counts) = (Cache::new(&options.spool), Counts::default());
        let bytes_min = options.content_bytes_min;
        let object_bytes_max = OBJECT_BYTES_MAX.min(payload_max);
        Self { bucket, cache, runtime, bytes_min, object_bytes_max, counts }
    }

    /// What was counted, without what the index knows.
    pub(super) fn stats(&self) -> ContentStats {
        ContentStats { cached_bytes: self.cache.bytes(), ..self.counts.stats() }
    }

    /// Puts the large content of a commit, all of it before this returns; where each value is.
    /// An error after the first object leaves objects to the sweep.
    pub(super) async fn put(
        &self,
        commit: Uuid,
        writes: &[(Vec<u8>, Option<Vec<u8>>)],
    ) -> Result<BTreeMap<Vec<u8>, Part>, String> {
        let mut parts = BTreeMap::new();
        let mut number = 0;
        for (unit, values) in large(writes, self.bytes_min) {
            for group in groups(&values, self.object_bytes_max) {
                let id = ObjectId { commit, number };
                number += 1;
                let bytes: Vec<u8> = group.iter().flat_map(|(_, value)| *value).copied().collect();
                let (length, hash) = (bytes.len() as u32, *blake3::hash(&bytes).as_bytes());
                self.put_one(&name(&unit, id), &bytes).await?;
                let (object, mut at) = (Described { id, length, hash }, 0);
                for (key, value) in group {
                    let length = value.len() as u16;
                    parts.insert(key.to_vec(), Part { object, at, length });
                    at += u32::from(length);
                }
            }
        }
        Ok(parts)
    }

    async fn put_one(&self, name: &str, bytes: &[u8]) -> Result<(), String> {
        let begun = Instant::now();
        loop {
            match self.bucket.put(name, bytes).await {
                Ok(()) => {
                    self.counts.put.add(1);
                    return Ok(());
                }
                Err(detail) if begun.elapsed() > PUT_WITHIN => {
                    return Err(format!("cannot put the object {name}: {detail}"));
                }
                Err(_) => tokio::time::sleep(PAUSE).await,
            }
        }
    }
}

/// Values by key.
type Values<'commit> = BTreeMap<&'commit [u8], &'commit [u8]>;

/// The content that is put as objects, by unit: the last value of each key.
fn large(writes: &[(Vec<u8>, Option<Vec<u8>>)], bytes_min: usize) -> BTreeMap<Vec<u8>, Values<'_>> {
    let mut units: BTreeMap<Vec<u8>, Values<'_>> = BTreeMap::new();
    for (key, value) in writes {
        if !unit::may_be_content(key) {
            continue;
        }
        let values = units.entry(unit::of(key)).or_default();
        match value {
            // The index keeps an empty value at no cost.
            Some(value) if !value.is_empty() => values.insert(key, value),
            _ => values.remove(&key[..]),
        };
    }
    units.retain(|id, values| {
        let bytes: usize = values.values().map(|value| value.len()).sum();
        unit::is_content(id) && bytes >= bytes_min
    });
    units
}

/// Values in groups of at most `bytes_max`.
fn groups<'commit>(
    values: &Values<'commit>,
    bytes_max: usize,
) -> Vec<Vec<(&'commit [u8], &'commit [u8])>> {
    let mut groups = vec![Vec::new()];
    let mut bytes = 0;
    for (key, value) in values {
        if bytes > 0 && bytes + value.len() > bytes_max {
            groups.push(Vec::new());
            bytes = 0;
        }
        bytes += value.len();
        groups.last_mut().expect("it begins with one group").push((*key, *value));
    }
    groups
}

/// The name of an object: its unit, the commit, and its number. Unique, so that the same content
/// that is stored again is another object, and a removal never meets it.
pub(super) fn name(unit: &[u8], ObjectId { commit, number }: ObjectId) -> String {
    format!("{}.{}.{number}", unit::words(unit), commit.simple())
}

/// What identifies the object of a name.
pub(super) fn id(name: &str) -> Option<ObjectId> {
    let (rest, number) = name.rsplit_once('.')?;
    let (_, commit) = rest.rsplit_once('.')?;
    Some(ObjectId { commit: Uuid::try_parse(commit).ok()?, number: number.parse().ok()? })
}

impl Object {
    pub(super) fn new(described: Described, unit: &[u8], contents: Arc<Contents>) -> Self {
        let (unit, place, turn) = (unit.into(), Mutex::default(), tokio::sync::Mutex::new(()));
        Self { described, unit, contents, place, is_released: AtomicBool::new(false), turn }
    }

    /// Notes that no record names it any more.
    pub(super) fn release(&self) {
        self.is_released.store(true, Ordering::Relaxed);
    }

    /// Its name in the bucket.
    pub(super) fn name(&self) -> String {
        name(&self.unit, self.described.id)
    }

    /// Reads a value. Blocks until the object is fetched, or that has failed.
    pub(super) fn read(self: &Arc<Self>, at: u32, length: u16) -> Result<Vec<u8>, EngineError> {
        let kept = match self.kept() {
            Some(kept) => {
                self.contents.counts.cache_hits.add(1);
                kept
            }
            None => self.wait()?,
        };
        let read = self.contents.cache.read(&kept, at, usize::from(length));
        read.map_err(|error| failed(error.to_string()))
    }

    fn kept(&self) -> Option<Kept> {
        let place = self.place.lock().unwrap_or_else(PoisonError::into_inner);
        place.as_ref().and_then(Perhaps::kept)
    }

    fn wait(self: &Arc<Self>) -> Result<Kept, EngineError> {
        let (object, (sender, receiver)) = (Arc::clone(self), channel());
        self.contents.runtime.spawn(async move {
            // The reader may have given up.
            let _ = sender.send(object.fetch().await);
        });
        let wait = || match receiver.recv_timeout(FETCHED_WITHIN + SLACK) {
            Ok(outcome) => outcome,
            Err(RecvTimeoutError::Timeout) => Err(self.too_late()),
            // The engine was closed.
            Err(RecvTimeoutError::Disconnected) => Err(EngineError::Stopped),
        };
        // A thread that runs tasks lets another one run them meanwhile.
        match Handle::try_current().map(|runtime| runtime.runtime_flavor()) {
            Ok(RuntimeFlavor::MultiThread) => tokio::task::block_in_place(wait),
            _ => wait(),
        }
    }

    /// Brings the object into the cache.
    pub(super) async fn fetch(&self) -> Result<Kept, EngineError> {
        let fetched = tokio::time::timeout(FETCHED_WITHIN, self.fetch_once()).await;
        let counts = &self.contents.counts;
        let fault = match fetched {
            Ok(Ok(kept)) => return Ok(kept),
            Ok(Err(fault)) => fault,
            Err(_) => {
                counts.fetches_unanswered.add(1);
                return Err(self.too_late());
            }
        };
        let is_released = self.is_released.load(Ordering::Relaxed);
        let count = match fault {
            FetchFault::Missing if is_released => &counts.fetches_removed,
            FetchFault::Missing => &counts.fetches_missing,
            FetchFault::Damaged { .. } => &counts.fetches_damaged,
            FetchFault::Unanswered(_) | FetchFault::Cache(_) => &counts.fetches_unanswered,
        };
        count.add(1);
        Err(self.failed(&fault))
    }

    fn failed(&self, fault: &FetchFault) -> EngineError {
        let (name, bucket) = (self.name(), &self.contents.bucket.name);
        failed(match fault {
            FetchFault::Missing => format!("object {name} is missing in {bucket}"),
            FetchFault::Unanswered(detail) => {
                format!("cannot get object {name} of {bucket}: {detail}")
            }
            FetchFault::Damaged { found } => format!(
                "object {name} of {bucket} is damaged: {found} bytes, expected {} with another hash",
                self.described.length
            ),
            FetchFault::Cache(detail) => format!("cannot keep object {name}: {detail}"),
        })
    }

    fn too_late(&self) -> EngineError {
        let (name, bucket) = (self.name(), &self.contents.bucket.name);
        failed(format!("{bucket} did not give object {name} within {FETCHED_WITHIN:?}"))
    }

    async fn fetch_once(&self) -> Result<Kept, FetchFault> {
        let _turn = self.turn.lock().await;
        if let Some(kept) = self.kept() {
            return Ok(kept);
        }
        let contents = &self.contents;
        let bytes = contents.bucket.get(&self.name()).await.map_err(|fault| match fault {
            GetFault::Missing => FetchFault::Missing,
            GetFault::Failed(detail) => FetchFault::Unanswered(detail),
        })?;
        let Described { length, hash, .. } = self.described;
        let found = bytes.len() as u64;
        if found != u64::from(length) || blake3::hash(&bytes).as_bytes() != &hash {
            return Err(FetchFault::Damaged { found });
        }
        let kept =
            contents.cache.keep(&bytes).map_err(|error| FetchFault::Cache(error.to_string()))?;
        contents.counts.fetched.add(1);
        contents.counts.fetched_bytes.add(found);
        *self.place.lock().unwrap_or_else(PoisonError::into_inner) = Some(kept.perhaps());
        Ok(kept)
    }
}

fn failed(detail: String) -> EngineError {
    EngineError::Failed { doing: READING, detail }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::key::{self, Space};
    use crate::nats::options::CONTENT_BYTES_MIN;

    #[test]
    fn a_name_leads_back_to_its_object() {
        let object = ObjectId { commit: Uuid::from_u128(77), number: 3 };
        let name = name(&key::hash(Space::Block, &[0xab; 32]), object);
        assert_eq!(name, format!("b.{}.0000000000000000000000000000004d.3", "ab".repeat(32)));
        assert_eq!(id(&name), Some(object));
        for foreign in ["", "b", "b.3", "a.b.c", "report.pdf"] {
            assert_eq!(id(foreign), None, "{foreign}");
        }
    }

    #[test]
    fn large_content_is_found_and_divided() {
        let block = key::hash(Space::Block, &[1; 32]);
        let pieces = (1..6u32).map(|piece| (key::piece(&block, piece), Some(vec![7; 4096])));
        let mut writes: Vec<_> = pieces.collect();
        writes.push((block.clone(), Some(Vec::new())));
        writes.push((key::piece(&block, 9), None));
        let small = key::hash(Space::Block, &[2; 32]);
        writes.push((small, Some(vec![7; 4096])));
        let session = key::id(Space::Session, Uuid::nil());
        writes.extend((0..9).map(|piece| (key::piece(&session, piece), Some(vec![7; 4096]))));
        let found = large(&writes, CONTENT_BYTES_MIN);
        assert_eq!(found.keys().collect::<Vec<_>>(), [&block], "only the large block is content");
        let sizes: Vec<_> = groups(&found[&block], 9000).iter().map(Vec::len).collect();
        assert_eq!(sizes, [2, 2, 1]);
        // What a later write of the commit takes back is not put.
        writes.extend((2..6u32).map(|piece| (key::piece(&block, piece), None)));
        assert_eq!(large(&writes, CONTENT_BYTES_MIN).len(), 0);
    }
}
