//! The sweep: removes objects that no message names any more.
//!
//! An object that lost its last value stays for an hour (`removed_kept`), so that cuts and readers
//! of any server can still read it. Then the server whose commit removed the value removes the
//! object. A crash leaves an object whose message was never published, or that was not removed.
//! One server at a time finds these by comparing the bucket with the index. It removes an object
//! that it found unnamed twice, at least `removed_kept` apart. No message can name such an object
//! later: a commit is published within minutes after its objects were put.

use std::collections::{HashMap, HashSet};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use super::content::{self, Contents, Object};
use super::lease;
use super::publish::Publisher;
use super::shared::Shared;
use super::writer;

/// The sweep looks for what is due this many times while removed content is kept. Chosen: content
/// stays at most a quarter longer.
const LOOK_SHARE: u32 = 4;
/// The whole bucket is compared once in this many times `removed_kept`. Chosen: a comparison reads
/// the names of all objects, and crashes are rare.
const COMPARE_SHARE: u32 = 6;
/// Shortest pause.
const PAUSE_MIN: Duration = Duration::from_secs(1);
/// Maximum number of missing objects named in the log.
const NAMED_MAX: usize = 20;

/// What removes objects.
pub(super) struct Sweeper {
    publisher: Arc<Publisher>,
    shared: Arc<Shared>,
    contents: Arc<Contents>,
    /// Time for which removed content is kept.
    removed_kept: Duration,
    /// What was found without a name, and when first.
    suspects: Mutex<HashMap<Suspect, Instant>>,
}

/// Something in the bucket that no message names.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
enum Suspect {
    /// An object, by its name.
    Object(String),
    /// Content without a name, by its id.
    Nameless(String),
}

impl Sweeper {
    pub(super) fn new(
        publisher: Arc<Publisher>,
        shared: Arc<Shared>,
        contents: Arc<Contents>,
        removed_kept: Duration,
    ) -> Self {
        Self { publisher, shared, contents, removed_kept, suspects: Mutex::default() }
    }

    /// Removes what is due, until the store is closed.
    pub(super) async fn run(self: Arc<Self>) {
        let mut compared = Instant::now();
        loop {
            tokio::time::sleep((self.removed_kept / LOOK_SHARE).max(PAUSE_MIN)).await;
            self.remove_due().await;
            if compared.elapsed() >= (self.removed_kept * COMPARE_SHARE).max(PAUSE_MIN) {
                compared = Instant::now();
                self.compare_logged().await;
            }
        }
    }

    /// As [`Sweeper::compare`]; a failure is repeated the next time.
    pub(super) async fn compare_logged(&self) {
        if let Err(error) = self.compare().await {
            tracing::warn!("Cannot look for content that no message names: {error}");
        }
    }

    /// Removes the objects that commits of this process removed long enough ago.
    pub(super) async fn remove_due(&self) {
        for object in self.shared.take_released(self.removed_kept) {
            let is_named = self.shared.index().has_object(object.described.id);
            if is_named {
                continue;
            }
            // One that cannot be removed now is found by a comparison.
            match self.contents.bucket.remove(&object.name()).await {
                Ok(()) => self.contents.counts.removed.add(1),
                Err(error) => tracing::warn!("Cannot remove object {}: {error}", object.name()),
            }
        }
    }

    /// Compares the bucket with the index, unless another server does: notes what no message
    /// names, removes what was noted long enough ago, and tells what is missing.
    async fn compare(&self) -> Result<(), String> {
        let taken = lease::take_named(Arc::clone(&self.publisher), "content").await;
        let Some(lease) = taken.map_err(|error| error.to_string())? else { return Ok(()) };
        let named_before: Vec<Arc<Object>> =
            self.shared.index().objects().map(Arc::clone).collect();
        let listing = self.contents.bucket.list().await?;
        // Whatever message named them before the listing is followed now.
        let caught_up = writer::catch_up_all(&self.publisher, &self.shared).await;
        caught_up.map_err(|error| error.to_string())?;
        self.tell_missing(&named_before, &listing.names);
        let mut found: Vec<Suspect> = listing.nameless.into_iter().map(Suspect::Nameless).collect();
        {
            let (index, removed) = (self.shared.index(), self.shared.to_remove());
            // Objects with other names are not ours; a reader may have removed ones.
            let is_stray = |name: &String| {
                content::id(name).is_some_and(|id| !index.has_object(id) && !removed.contains(&id))
            };
            let strays = listing.names.into_iter().filter(is_stray);
            found.extend(strays.map(Suspect::Object));
        }
        for suspect in self.due(&found) {
            if lease.is_lost() {
                break;
            }
            match &suspect {
                Suspect::Object(name) => self.contents.bucket.remove(name).await?,
                Suspect::Nameless(id) => self.contents.bucket.remove_nameless(id).await?,
            }
            self.contents.counts.leftovers.add(1);
        }
        Ok(())
    }

    /// Notes what was found without a name; returns what was so for long enough.
    fn due(&self, found: &[Suspect]) -> Vec<Suspect> {
        let mut suspects = self.suspects.lock().unwrap_or_else(PoisonError::into_inner);
        let known: HashSet<&Suspect> = found.iter().collect();
        suspects.retain(|suspect, _| known.contains(suspect));
        let now = Instant::now();
        let mut due = Vec::new();
        for suspect in found {
            let since = suspects.get(suspect).copied();
            match since {
                Some(since) if now.duration_since(since) >= self.removed_kept => {
                    due.push(suspect.clone());
                }
                Some(_) => {}
                None => {
                    suspects.insert(suspect.clone(), now);
                }
            }
        }
        due
    }

    /// Tells which objects are missing that messages name.
    fn tell_missing(&self, named: &[Arc<Object>], listed: &[String]) {
        let listed: HashSet<_> = listed.iter().filter_map(|name| content::id(name)).collect();
        let index = self.shared.index();
        let is_missing = |object: &&Arc<Object>| {
            let id = object.described.id;
            !listed.contains(&id) && index.has_object(id)
        };
        let missing: Vec<_> = named.iter().filter(is_missing).collect();
        for object in missing.iter().take(NAMED_MAX) {
            let (name, bucket) = (object.name(), &self.contents.bucket.name);
            tracing::error!("Object {name} is missing in {bucket}: what it holds cannot be read");
        }
        self.contents.counts.missing.set(missing.len() as u64);
    }
}
