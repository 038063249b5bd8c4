//! The version that a training extends, whose content stays bit by bit.

use std::sync::Arc;

use palpate_schemas::ObjectReport;

use super::material::Material;
use crate::model::Model;

/// The version that a training extends.
pub(crate) struct Base {
    pub(crate) model: Arc<Model>,
    /// The reports on its objects.
    pub(crate) reports: Vec<ObjectReport>,
}

impl Base {
    /// Index of each material's object in the version; `None` for new ones.
    pub(super) fn places(&self, materials: &[Material]) -> Vec<Option<usize>> {
        let place = |new: &Material| self.model.objects.iter().position(|o| o.id == new.object.id);
        materials.iter().map(place).collect()
    }
}

/// The `known` items, with each `new` one at its index if it has one, else at the end.
pub(super) fn extended<T: Clone>(known: &[T], places: &[Option<usize>], new: Vec<T>) -> Vec<T> {
    let mut all = known.to_vec();
    for (new, place) in new.into_iter().zip(places) {
        match place {
            Some(place) => all[*place] = new,
            None => all.push(new),
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn new_items_replace_known_ones_or_follow_them() {
        let found = extended(&["mug", "gear", "hand"], &[Some(1), None], vec!["gear!", "cup"]);
        assert_eq!(found, ["mug", "gear!", "hand", "cup"]);
        assert_eq!(extended(&[], &[None, None], vec![1, 2]), [1, 2]);
    }
}
