//! Objects left out of a training, so that one that cannot be trained does not make it fail.

use palpate_schemas::SkippedObject;
use palpate_store::catalogue::VersionObject;

use super::material::Material;
use super::{Plan, TrainingFailure};

/// The objects left out so far, with reasons.
pub(super) struct Skipped<'a> {
    plan: &'a Plan,
    objects: Vec<(VersionObject, TrainingFailure)>,
}

impl<'a> Skipped<'a> {
    /// No objects left out.
    pub(super) fn new(plan: &'a Plan) -> Self {
        Self { plan, objects: Vec::new() }
    }

    /// The usable materials; the others' objects are left out. Fails with the first failure
    /// that concerns no object, or any if the plan is strict.
    pub(super) fn keep(
        &mut self,
        results: Vec<Result<Material, TrainingFailure>>,
    ) -> Result<Vec<Material>, TrainingFailure> {
        let mut kept = Vec::with_capacity(results.len());
        for result in results {
            match result {
                Ok(material) => kept.push(material),
                Err(failure) => self.skip(failure)?,
            }
        }
        Ok(kept)
    }

    /// The materials without the one named by a failure.
    pub(super) fn without(
        &mut self,
        failure: TrainingFailure,
        mut materials: Vec<Material>,
    ) -> Result<Vec<Material>, TrainingFailure> {
        let named = failure.object().map(str::to_owned);
        let n_before = materials.len();
        materials.retain(|material| Some(&material.object.name) != named.as_ref());
        if materials.len() == n_before {
            // No object is at fault, so another attempt would fail again.
            return Err(failure);
        }
        self.skip(failure)?;
        Ok(materials)
    }

    /// Fails when no object is left.
    pub(super) fn expect_some(&mut self, materials: &[Material]) -> Result<(), TrainingFailure> {
        if !materials.is_empty() || self.objects.is_empty() {
            return Ok(());
        }
        let n_objects = self.objects.len();
        let (_, first) = self.objects.remove(0);
        match n_objects {
            1 => Err(first),
            _ => Err(TrainingFailure::NothingLeft { n_objects, first: first.to_string() }),
        }
    }

    /// The left-out objects for the report, in the plan's order.
    pub(super) fn reported(self) -> Vec<SkippedObject> {
        let place = |id| self.plan.objects.iter().position(|object| object.id == id);
        let mut reported: Vec<SkippedObject> = self
            .objects
            .into_iter()
            .map(|(object, failure)| SkippedObject {
                id: object.id,
                name: object.name,
                reason: failure.to_string(),
            })
            .collect();
        reported.sort_by_key(|object| place(object.id));
        reported
    }

    fn skip(&mut self, failure: TrainingFailure) -> Result<(), TrainingFailure> {
        let object = match failure.object() {
            Some(name) if !self.plan.strict => {
                self.plan.objects.iter().find(|object| object.name == name).cloned()
            }
            _ => None,
        };
        match object {
            Some(object) => {
                tracing::warn!(object.id = %object.id, "Left object {:?} out: {failure}",
                    object.name);
                self.objects.push((object, failure));
                Ok(())
            }
            None => Err(failure),
        }
    }
}
