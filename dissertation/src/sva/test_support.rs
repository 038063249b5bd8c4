//! Hand-made patches, maps and catalogues whose pairs can be counted on paper.

use std::sync::Arc;

use glam::DVec3;

use super::SvaOptions;
use crate::patch::Patch;
use crate::patch_pair::DistanceBins;
use crate::sva::model::{ObjectMap, SvaModel};
use palpate_core::descriptor::DescriptorKind;
use palpate_core::units::MM;
use palpate_core::vocabulary::{Association, AssociationRule, ClassIdx, Vocabulary};

/// Number of classes of the maps; the last is that of patches that no query names.
pub(super) const N_CLASSES: usize = 6;

/// Ten bins of 10 mm.
pub(super) fn distances() -> DistanceBins {
    DistanceBins::new(0.0, 100.0 * MM, 10).unwrap()
}

/// A patch at a position (mm), with its normal along +z and its classes.
pub(super) fn patch(at_mm: [f64; 3], classes: &[(u8, f64)]) -> Patch {
    let classes = classes
        .iter()
        .map(|(class, weight)| Association { class: ClassIdx(*class), weight: *weight });
    Patch {
        position: DVec3::from_array(at_mm) * MM,
        normal: DVec3::Z,
        normal_confidence: 1.0,
        classes: classes.collect(),
    }
}

/// A map of `patches`, filled up with patches of the unnamed class to `n` in all.
pub(super) fn map(patches: &[Patch], n: usize) -> Arc<ObjectMap> {
    let unnamed = [(N_CLASSES as u8 - 1, 1.0)];
    let filled = (patches.len()..n).map(|k| patch([0.0, 2.0 * k as f64, -5.0], &unnamed));
    let all: Vec<Patch> = patches.iter().cloned().chain(filled).collect();
    Arc::new(ObjectMap::build(&all, DVec3::ZERO, N_CLASSES, distances()).unwrap())
}

/// A catalogue of maps, for the Vectorize descriptor.
pub(super) fn catalogue(objects: Vec<Arc<ObjectMap>>) -> Arc<SvaModel> {
    let vocabulary = Vocabulary {
        descriptor: DescriptorKind::Vectorize,
        rows: 6,
        cols: 6,
        mean: vec![0.0; 36],
        medoids: vec![vec![1.0 / 6.0; 36]; N_CLASSES],
        spreads: vec![0.1; N_CLASSES],
    };
    let association = AssociationRule::default();
    Arc::new(SvaModel { vocabulary, association, objects })
}

/// The printed filter with a single rotation per match, the likeliest.
pub(super) fn one_turn() -> SvaOptions {
    SvaOptions { sigma_init: 1e-6, ..SvaOptions::literal() }
}
