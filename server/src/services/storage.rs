//! Use of the disk: the bytes that each key holds, and the things whose removal would free most.
//!
//! The bytes of keys are counted with every write. The largest things are found by a survey
//! of all holdings, linear in the number of things: at the start, on request, and
//! periodically for at most a hundredth of the time.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use palpate_schemas as wire;
use palpate_schemas::{StorageHolder, StoredKind, StoredThing};
use palpate_store::database::Database;
use palpate_store::engine::Account;
use palpate_store::engine::EngineStats;
use palpate_store::holding::{Holding, ThingKind, Who};
use tokio::sync::watch;
use uuid::Uuid;

use crate::asker::Asker;
use crate::cause::Cause;
use crate::client::Client;
use crate::clock::pause;
use crate::figures::help::help;
use crate::limits::megabytes;
use crate::services::keys::Keys;

/// Number of things named.
const NAMED: usize = 10;
/// Number of things named in a sentence.
const IN_WORDS: usize = 3;
/// Number of keys with a figure of their own in the metrics.
const FIGURES: usize = 100;
/// Metric of the bytes that a key holds.
const KEY_BYTES: &str = "palpate_store_key_bytes";
/// Metric of the bytes that removing a thing frees.
const LARGEST_BYTES: &str = "palpate_store_largest_bytes";
/// Minimum pause between two surveys, and its multiple of the last one's duration.
const PAUSE: Duration = Duration::from_secs(60);
const PAUSES: u32 = 100;

/// The account of the request that a commit is made for, with the quota of each key.
pub(crate) fn accounts(quota: Option<u64>) -> Who {
    Arc::new(move || match Asker::current().client()? {
        Client::Key(key) => Some(Account { key, quota }),
        Client::Address(_) => Some(Account { key: Uuid::nil(), quota: None }),
    })
}

/// Use of the disk.
pub(crate) struct Storage {
    store: Database,
    keys: Arc<Keys>,
    quota: Option<u64>,
    /// The largest things at the last survey, largest first.
    largest: Mutex<Vec<StoredThing>>,
}

impl Storage {
    pub(crate) fn new(store: Database, keys: Arc<Keys>, quota: Option<u64>) -> Self {
        Self { store, keys, quota, largest: Mutex::default() }
    }

    /// Bytes that one key may hold.
    pub(crate) fn quota(&self) -> Option<u64> {
        self.quota
    }

    /// Use of the disk, surveyed now. Blocks.
    pub(crate) fn show(&self) -> Result<wire::Storage, Cause> {
        self.survey()?;
        let stats = self.store.stats()?;
        Ok(wire::Storage {
            live_bytes: stats.live_bytes,
            stored_bytes: stats.bytes,
            free_bytes: stats.free_bytes,
            reserve_bytes: stats.reserve_bytes,
            n_readings: self.store.journal().n_readings()? + self.store.training().n_readings()?,
            quota_bytes: self.quota,
            holders: self.holders(),
            largest: self.largest(&stats),
        })
    }

    /// A sentence that names the things whose removal would free most.
    pub(crate) fn advice(&self, stats: &EngineStats) -> String {
        let largest = self.largest(stats);
        let words = largest.iter().take(IN_WORDS).map(|thing| {
            format!("{} {} ({})", name(thing.kind), thing.name, megabytes(thing.bytes))
        });
        match words.collect::<Vec<_>>().join(", ") {
            none if none.is_empty() => String::new(),
            words => format!("; most would be freed by removing {words}"),
        }
    }

    /// Figures of the bytes that keys hold and of the largest things, in the text format of
    /// Prometheus. They are written here because the recorder of metrics would keep those of
    /// removed things.
    pub(crate) fn figures(&self) -> String {
        let Ok(stats) = self.store.stats() else { return String::new() };
        let mut text = header(KEY_BYTES);
        for StorageHolder { key, bytes } in self.holders().into_iter().take(FIGURES) {
            let (id, name) = key.map_or_else(Default::default, |key| {
                (key.key_id.to_string(), key.key_name.unwrap_or_default())
            });
            let labels = format!("key_id=\"{id}\",key=\"{}\"", label(&name));
            text.push_str(&format!("{KEY_BYTES}{{{labels}}} {bytes}\n"));
        }
        text.push_str(&header(LARGEST_BYTES));
        for thing in self.largest(&stats) {
            let labels = format!("kind=\"{}\",name=\"{}\"", name(thing.kind), label(&thing.name));
            text.push_str(&format!("{LARGEST_BYTES}{{{labels}}} {}\n", thing.bytes));
        }
        text
    }

    /// Surveys periodically until the server stops.
    pub(crate) async fn watch(self: Arc<Self>, mut stopping: watch::Receiver<bool>) {
        loop {
            let (storage, start) = (Arc::clone(&self), Instant::now());
            let surveyed = tokio::task::spawn_blocking(move || storage.survey()).await;
            if let Ok(Err(error)) = surveyed {
                tracing::warn!(%error, "Cannot tell what takes most room: {error}");
            }
            if !pause(PAUSE.max(start.elapsed() * PAUSES), &mut stopping).await {
                return;
            }
        }
    }

    fn holders(&self) -> Vec<StorageHolder> {
        let held = self.store.held().into_iter().map(|(key, bytes)| StorageHolder {
            key: (!key.is_nil()).then(|| self.keys.writer(key)),
            bytes,
        });
        let mut holders: Vec<StorageHolder> = held.collect();
        holders.sort_by_key(|holder| std::cmp::Reverse(holder.bytes));
        holders
    }

    /// The largest things, largest first, with the bytes that a compaction would free.
    fn largest(&self, stats: &EngineStats) -> Vec<StoredThing> {
        let mut largest = self.largest.lock().unwrap_or_else(PoisonError::into_inner).clone();
        largest.push(StoredThing {
            kind: StoredKind::Compaction,
            name: "of removed and replaced records".to_owned(),
            id: None,
            bytes: stats.bytes.saturating_sub(stats.live_bytes),
        });
        largest.retain(|thing| thing.bytes > 0);
        largest.sort_by_key(|thing| std::cmp::Reverse(thing.bytes));
        largest
    }

    /// Finds the largest things.
    fn survey(&self) -> Result<(), Cause> {
        let mut ranking = Ranking::default();
        self.store.holdings(|holding| ranking.add(holding))?;
        let mut found = ranking.finish();
        for catalogue in self.store.catalogues().list(None, usize::MAX - 1)?.items {
            let bytes = self.store.catalogues().block_bytes(catalogue.id)?;
            found.push((ThingKind::Catalogue, catalogue.id, bytes));
        }
        found.sort_by_key(|(_, _, bytes)| std::cmp::Reverse(*bytes));
        found.truncate(NAMED);
        let named: Result<Vec<_>, _> = found.into_iter().map(|thing| self.named(thing)).collect();
        let largest = named?.into_iter().flatten().collect();
        *self.largest.lock().unwrap_or_else(PoisonError::into_inner) = largest;
        Ok(())
    }

    /// A thing with its name, unless it is gone by now.
    fn named(
        &self,
        (kind, id, bytes): (ThingKind, Uuid, u64),
    ) -> Result<Option<StoredThing>, Cause> {
        let store = &self.store;
        let (kind, name) = match kind {
            ThingKind::Session => (
                StoredKind::Session,
                store.sessions().find(id)?.map(|session| session.id.to_string()),
            ),
            ThingKind::Object => {
                (StoredKind::Object, store.objects().find(id)?.map(|object| object.name))
            }
            ThingKind::Sensor => {
                (StoredKind::Sensor, store.sensors().find(id)?.map(|sensor| sensor.name))
            }
            ThingKind::Catalogue => (StoredKind::Catalogue, Some(store.catalogues().get(id)?.name)),
            ThingKind::Job | ThingKind::Robot => return Ok(None),
        };
        Ok(name.map(|name| StoredThing { kind, name, id: Some(id), bytes }))
    }
}

/// The lines before the values of a gauge.
fn header(metric: &str) -> String {
    format!("# HELP {metric} {}\n# TYPE {metric} gauge\n", help(metric))
}

/// A label's value, escaped.
fn label(value: &str) -> String {
    value.replace('\\', "\\\\").replace('"', "\\\"").replace('\n', "\\n")
}

fn name(kind: StoredKind) -> &'static str {
    match kind {
        StoredKind::Session => "session",
        StoredKind::Object => "object",
        StoredKind::Sensor => "sensor",
        StoredKind::Catalogue => "catalogue",
        StoredKind::Compaction => "compaction",
    }
}

/// The largest sessions, and all objects and sensors, with their bytes.
#[derive(Default)]
struct Ranking {
    /// The session whose holdings are being read; they are adjacent.
    session: Option<(Uuid, u64)>,
    sessions: Vec<(Uuid, u64)>,
    others: BTreeMap<(ThingKind, Uuid), u64>,
}

impl Ranking {
    fn add(&mut self, holding: Holding) {
        match (holding.kind, &mut self.session) {
            (ThingKind::Session, Some((id, bytes))) if *id == holding.id => *bytes += holding.bytes,
            (ThingKind::Session, _) => {
                self.end_session();
                self.session = Some((holding.id, holding.bytes));
            }
            (ThingKind::Object | ThingKind::Sensor, _) => {
                *self.others.entry((holding.kind, holding.id)).or_default() += holding.bytes;
            }
            // Catalogues are measured by their blocks; jobs and names cannot be removed for room.
            (ThingKind::Catalogue | ThingKind::Job | ThingKind::Robot, _) => {}
        }
    }

    fn end_session(&mut self) {
        self.sessions.extend(self.session.take());
        if self.sessions.len() > 16 * NAMED {
            self.shorten();
        }
    }

    fn shorten(&mut self) {
        self.sessions.sort_by_key(|(_, bytes)| std::cmp::Reverse(*bytes));
        self.sessions.truncate(NAMED);
    }

    fn finish(mut self) -> Vec<(ThingKind, Uuid, u64)> {
        self.end_session();
        self.shorten();
        let sessions = self.sessions.into_iter();
        let sessions = sessions.map(|(id, bytes)| (ThingKind::Session, id, bytes));
        sessions
            .chain(self.others.into_iter().map(|((kind, id), bytes)| (kind, id, bytes)))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_survey_finds_the_largest_of_many_sessions() {
        let mut ranking = Ranking::default();
        for session in 0..2000u128 {
            for key in [1, 2] {
                ranking.add(Holding {
                    kind: ThingKind::Session,
                    id: Uuid::from_u128(session),
                    key: Uuid::from_u128(key),
                    // 7 and 2,000 have no common factor: every size comes once.
                    bytes: (session * 7 % 2000) as u64,
                });
            }
        }
        let sizes: Vec<u64> = ranking.finish().iter().map(|(_, _, bytes)| *bytes).collect();
        assert_eq!(sizes[..3], [3998, 3996, 3994]);
        assert_eq!(sizes.len(), NAMED);
    }
}
