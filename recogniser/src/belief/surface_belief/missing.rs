//! Objects of a divided catalogue whose part did not answer.

use std::collections::BTreeSet;

use palpate_core::object::ObjectIdx;

use super::SurfaceBelief;

impl SurfaceBelief {
    /// The objects that are left out since their part of a divided catalogue did not answer, in the
    /// order of the catalogue. The probabilities are those given that the object is none of them.
    /// They stay out; a belief from the same readings folded anew asks for them again.
    #[must_use]
    pub fn missing_objects(&self) -> Vec<ObjectIdx> {
        let objects = self.rest.explained().objects.iter().enumerate();
        let missing = objects.filter(|(_, object)| object.is_missing);
        missing.map(|(index, _)| ObjectIdx(index as u32)).collect()
    }

    /// Leaves objects that one component misses out of all.
    pub(super) fn leave_out_missing(&mut self) {
        let of = self.components().flat_map(|component| {
            let objects = component.explained().objects.iter().enumerate();
            objects.filter(|(_, object)| object.is_missing).map(|(index, _)| index)
        });
        let missing: BTreeSet<usize> = of.collect();
        for index in &missing {
            self.common.prior.log_objects[*index] = f64::NEG_INFINITY;
        }
        if !missing.is_empty() {
            self.rest.leave_out(&missing);
            self.drifting.iter_mut().for_each(|drifting| drifting.leave_out(&missing));
        }
    }
}
