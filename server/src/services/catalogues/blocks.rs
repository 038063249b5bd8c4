//! Blocks of 64 objects that this member holds of divided versions, within the memory budget of
//! models, and what they answer.
//!
//! A block is read from the store when it is first needed, one at a time, and leaves like any
//! other model that was not used for long. Functions here block their thread.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};

use palpate_core::stop::Stop;
use palpate_recogniser::belief::{parts, prepare};
use palpate_recogniser::model::{OBJECTS_PER_BLOCK, SurfaceMap, SurfaceModel};
use palpate_recogniser::options::SurfaceOptions;
use palpate_store::catalogue::{Catalogues as Table, Manifest};
use palpate_store::error::StoreError;
use palpate_store::model_codec::{ModelPart, Surfaces};
use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};
use thiserror::Error;
use uuid::Uuid;

use super::loading::{Held, Key, bytes_expected};
use super::memory::{Memory, NoRoom};
use crate::members::{Block, HeldVersion, Members, Reply};
use crate::model::Model;

/// Number of single maps kept for answers. Chosen: those of the likely objects of a few sessions.
const MAPS_MAX: usize = 32;

/// The blocks of this member.
pub(crate) struct Blocks {
    table: Table,
    memory: Arc<Memory<Key, Model>>,
    members: Arc<Members>,
    /// Held by the one that reads a block: others may need the same, or the same memory.
    reading: Mutex<()>,
    /// Threads that build the tables of a block that is read.
    threads: ThreadPool,
}

/// Reason why a block is not held.
#[derive(Debug, Error)]
pub(super) enum NotHeld {
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error("the version has no block {number}")]
    NoBlock { number: u32 },
    #[error("reading it panicked")]
    Panicked,
    #[error("there is no room for it in the memory of models: {0:?}")]
    NoRoom(NoRoom),
}

/// Number of blocks of a version.
pub(super) fn n_blocks(n_objects: usize) -> u32 {
    u32::try_from(n_objects.div_ceil(OBJECTS_PER_BLOCK)).unwrap_or(u32::MAX)
}

/// Places of a block's objects in a version.
fn places(number: u32, n_objects: usize) -> Range<usize> {
    let begin = (number as usize).saturating_mul(OBJECTS_PER_BLOCK).min(n_objects);
    begin..(begin + OBJECTS_PER_BLOCK).min(n_objects)
}

/// Expected bytes of this many objects of a version.
fn expected(manifest: &Manifest, n: usize) -> u64 {
    let n_objects = manifest.objects.len().max(1) as u64;
    bytes_expected(manifest, ModelPart::Surface).saturating_mul(n as u64) / n_objects
}

impl Blocks {
    pub(super) fn new(
        table: Table,
        memory: Arc<Memory<Key, Model>>,
        members: Arc<Members>,
        threads: usize,
    ) -> Result<Self, ThreadPoolBuildError> {
        let named = ThreadPoolBuilder::new().thread_name(|thread| format!("blocks-{thread}"));
        let threads = named.num_threads(threads.max(1)).build()?;
        Ok(Self { table, memory, members, reading: Mutex::default(), threads })
    }

    pub(super) fn members(&self) -> &Arc<Members> {
        &self.members
    }

    /// A block in memory, if it is there.
    pub(super) fn known(&self, block: &Block) -> Option<Arc<Model>> {
        self.memory.get(&(block.catalogue, block.version, Held::Block(block.number)))
    }

    /// Whether this member answers for a block itself: it has it in memory, or should hold it and
    /// nobody has.
    pub(super) fn is_near(&self, block: &Block) -> bool {
        self.is_in_memory(block)
            || (self.members.is_own(block) && !self.members.is_held_elsewhere(block))
    }

    /// A block, from memory or the store.
    pub(super) fn block(&self, block: &Block) -> Result<Arc<Model>, NotHeld> {
        if let Some(model) = self.known(block) {
            return Ok(model);
        }
        // A thread of a pool that waits for its parts takes up other work, which may wait for the
        // lock that it holds: so another thread reads.
        let reading = || {
            let _reading = self.reading.lock().unwrap_or_else(PoisonError::into_inner);
            self.threads.install(|| self.read(block))
        };
        let read = std::thread::scope(|scope| scope.spawn(reading).join());
        read.unwrap_or(Err(NotHeld::Panicked))
    }

    fn read(&self, block: &Block) -> Result<Arc<Model>, NotHeld> {
        if let Some(model) = self.known(block) {
            return Ok(model);
        }
        let manifest = self.table.manifest(block.catalogue, block.version)?;
        let n_objects = manifest.objects.len();
        let places = places(block.number, n_objects);
        if places.is_empty() {
            return Err(NotHeld::NoBlock { number: block.number });
        }
        let expected = expected(&manifest, places.len());
        self.memory.make_room(expected).map_err(NotHeld::NoRoom)?;
        let stop = Stop::default();
        let Surfaces { space, calibration, maps } =
            self.table.surfaces(&manifest, places, &stop)?;
        let surfaces = SurfaceModel::of_block(space, calibration, maps, n_objects);
        prepare(&surfaces, &SurfaceOptions::default());
        let bytes = surfaces.bytes() as u64;
        let model = self.model(manifest, surfaces, &stop)?;
        let key = (block.catalogue, block.version, Held::Block(block.number));
        let kept = self.memory.keep(key, model, bytes).map_err(NotHeld::NoRoom)?;
        metrics::counter!("palpate_blocks_read_total").increment(1);
        tracing::info!(
            catalogue.id = %block.catalogue, block.version, block.number,
            "Holds block {} of version {} of catalogue {}",
            block.number, block.version, block.catalogue
        );
        Ok(kept)
    }

    /// Surfaces as a model without names.
    fn model(
        &self,
        manifest: Manifest,
        surfaces: SurfaceModel,
        stop: &Stop,
    ) -> Result<Model, StoreError> {
        let mut core = self.table.shared(&manifest, stop)?;
        core.surface = Some(Arc::new(surfaces));
        Ok(Model {
            catalogue: manifest.catalogue,
            name: String::new(),
            version: manifest.version,
            core: Arc::new(core),
            objects: Vec::new(),
            origins_in_model: Arc::default(),
            symmetries: Arc::default(),
            prepared: None,
        })
    }

    /// What this member replies to requests to blocks, in their order.
    pub(super) fn replies(&self, requests: &[(Block, &[u8])]) -> Vec<Reply> {
        // All are there before work on them is shared out.
        let models: Vec<_> = requests.iter().map(|(block, _)| self.block(block)).collect();
        let both = models.into_par_iter().zip(requests);
        both.map(|(model, (block, request))| reply(model, block, request)).collect()
    }

    /// The map of one object of a version, from a block in memory or the store.
    pub(super) fn map(
        &self,
        (catalogue, version): (Uuid, u32),
        object: usize,
    ) -> Result<Arc<SurfaceMap>, NotHeld> {
        let number = u32::try_from(object / OBJECTS_PER_BLOCK).unwrap_or(u32::MAX);
        let no_block = || NotHeld::NoBlock { number };
        if let Some(model) = self.known(&Block { catalogue, version, number }) {
            let maps = model.surface().map(|surfaces| surfaces.maps()).unwrap_or_default();
            return maps.get(object % OBJECTS_PER_BLOCK).cloned().ok_or_else(no_block);
        }
        let place = u32::try_from(object).map_err(|_| no_block())?;
        let key = (catalogue, version, Held::Map(place));
        let first = |model: &Model| {
            let maps = model.surface().map(|surfaces| surfaces.maps()).unwrap_or_default();
            maps.first().cloned().ok_or_else(no_block)
        };
        if let Some(model) = self.memory.get(&key) {
            return first(&model);
        }
        let manifest = self.table.manifest(catalogue, version)?;
        let stop = Stop::default();
        let Surfaces { space, calibration, maps } =
            self.table.surfaces(&manifest, object..object + 1, &stop)?;
        let surfaces = SurfaceModel::new(space, calibration, maps);
        let bytes = surfaces.bytes() as u64;
        let model = self.model(manifest, surfaces, &stop)?;
        let map = first(&model);
        let is_map = |key: &Key| matches!(key.2, Held::Map(_));
        self.memory.leave(MAPS_MAX - 1, is_map);
        // Without room it serves this once.
        if let Err(full) = self.memory.keep(key, model, bytes) {
            tracing::debug!("A map is not kept: {full:?}");
        }
        map
    }

    /// The versions that this member uses, or holds blocks of.
    pub(crate) fn held(&self) -> Vec<HeldVersion> {
        let mut versions: BTreeMap<(Uuid, u32), (bool, Vec<u32>)> = BTreeMap::new();
        for (catalogue, version, held) in self.memory.keys() {
            let entry = || (false, Vec::new());
            match held {
                Held::Outlines => {
                    versions.entry((catalogue, version)).or_insert_with(entry).0 = true;
                }
                Held::Block(number) => {
                    versions.entry((catalogue, version)).or_insert_with(entry).1.push(number);
                }
                Held::Part(_) | Held::Map(_) => {}
            }
        }
        let shown = |((catalogue, version), (is_used, held))| {
            let manifest = self.table.manifest(catalogue, version).ok()?;
            let n_blocks = n_blocks(manifest.objects.len());
            Some(HeldVersion { catalogue, version, n_blocks, is_used, held })
        };
        versions.into_iter().filter_map(shown).collect()
    }

    /// Reads one block that this member should hold of the versions in use, and drops those that
    /// others hold instead; whether there is more to do.
    pub(super) fn tidy(&self) -> bool {
        let held = self.held();
        for version in &held {
            let HeldVersion { catalogue, version, held, .. } = version;
            for number in held {
                let block = Block { catalogue: *catalogue, version: *version, number: *number };
                if !self.members.is_own(&block) && self.members.is_held_by_holders(&block) {
                    self.memory.remove(&(*catalogue, *version, Held::Block(*number)));
                }
            }
        }
        let own = held.iter().filter(|version| version.is_used);
        let own = own.map(|version| (version.catalogue, version.version, version.n_blocks));
        let mut used: Vec<_> = own.chain(self.members.used_elsewhere()).collect();
        used.sort_unstable();
        used.dedup();
        let all = used.into_iter().flat_map(|(catalogue, version, n_blocks)| {
            (0..n_blocks).map(move |number| Block { catalogue, version, number })
        });
        let absent = all.filter(|block| self.members.is_own(block) && !self.is_in_memory(block));
        let absent: Vec<Block> = absent.collect();
        metrics::gauge!("palpate_blocks_absent").set(absent.len() as f64);
        let Some(first) = absent.iter().find(|block| self.fits(block)) else { return false };
        match self.block(first) {
            Ok(_held) => absent.len() > 1,
            Err(error) => {
                tracing::debug!("Cannot hold {first:?}: {error}");
                false
            }
        }
    }

    /// Whether there is room for a block without removing anything: nobody waits for it yet.
    fn fits(&self, block: &Block) -> bool {
        let manifest = self.table.manifest(block.catalogue, block.version);
        manifest.is_ok_and(|manifest| {
            let n = places(block.number, manifest.objects.len()).len();
            self.memory.fits(expected(&manifest, n))
        })
    }

    /// Whether a block is in memory, without a use of it.
    fn is_in_memory(&self, block: &Block) -> bool {
        self.memory.has(&(block.catalogue, block.version, Held::Block(block.number)))
    }
}

/// The reply of a block to a request.
fn reply(model: Result<Arc<Model>, NotHeld>, block: &Block, request: &[u8]) -> Reply {
    let surfaces = match &model {
        Ok(model) => model.surface(),
        Err(error) => {
            tracing::warn!(
                catalogue.id = %block.catalogue, block.version, block.number, %error,
                "Cannot hold block {} of version {}: {error}", block.number, block.version
            );
            return Reply::NotHeld;
        }
    };
    let Ok(surfaces) = surfaces else { return Reply::NotHeld };
    match parts::answer(surfaces, request) {
        Ok(answer) => Reply::Answer(answer),
        Err(_not_work) => Reply::NotUnderstood,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_are_of_64_consecutive_objects() {
        assert_eq!([0, 1, 64, 65, 1000].map(n_blocks), [0, 1, 1, 2, 16]);
        assert_eq!(places(0, 150), 0..64);
        assert_eq!(places(2, 150), 128..150);
        assert!(places(3, 150).is_empty() && places(u32::MAX, 150).is_empty());
    }
}
