//! Interest points of a version's objects: computed when first asked for, and kept within a budget.

use std::sync::Arc;

use palpate_core::object::ObjectIdx;
use palpate_recogniser::next_touch::interest::{Interest, interest};
use palpate_schemas as wire;
use palpate_store::model_codec::ModelPart;
use uuid::Uuid;

use super::memory::Memory;
use super::{CatalogueError, Catalogues, Model};
use crate::asker::Asker;
use crate::wire::interest::map;

/// Memory of the interest of all objects, bytes. Chosen: about a thousand objects.
const BYTES_MAX: u64 = 16 << 20;

/// An object of a version.
type Key = (Uuid, u32, ObjectIdx);

/// The interest of objects that were asked for.
pub(super) struct Interests {
    kept: Memory<Key, Interest>,
    /// Locked while one is computed: requests for the same object share it.
    finding: tokio::sync::Mutex<()>,
}

impl Interests {
    pub(super) fn new() -> Self {
        Self { kept: Memory::new(BYTES_MAX), finding: tokio::sync::Mutex::new(()) }
    }
}

impl Catalogues {
    /// How much touches tell at the places of one object of a version.
    pub(crate) async fn interest(
        &self,
        name: &str,
        version: &str,
        object: &str,
    ) -> Result<wire::InterestMap, CatalogueError> {
        let (model, place) = self.object_of(name, version, object, ModelPart::Surface).await?;
        let object = ObjectIdx(place as u32);
        let key = (model.catalogue, model.version, object);
        let found = match self.interests.kept.get(&key) {
            Some(found) => found,
            None => self.find_interest(&model, key).await?,
        };
        Ok(map(&model.objects, object, &found))
    }

    async fn find_interest(
        &self,
        model: &Model,
        key: Key,
    ) -> Result<Arc<Interest>, CatalogueError> {
        let Interests { kept, finding } = &self.interests;
        let _finding = finding.lock().await;
        if let Some(found) = kept.get(&key) {
            return Ok(found);
        }
        let (surface, stop) = (Arc::clone(model.surface()?), Asker::current().overdue().clone());
        let find = move || interest(&surface, key.2, &stop);
        let found = self.pool.place()?.run_long(find).await?;
        // While answers use the whole budget this one is not kept, and is computed again.
        let bytes = found.bytes() as u64;
        Ok(kept.keep(key, found.clone(), bytes).unwrap_or_else(|_full| Arc::new(found)))
    }
}
