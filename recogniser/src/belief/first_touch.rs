//! The evidence of one touch: its appearance. Equation R17 of docs/recogniser.md, k = 1.

use super::object::{ObjectBelief, for_each_object};
use crate::verify::evidence::Evidence;

/// Weighs the objects by the first touch's appearance at their first patches, at most
/// `patches_max`.
pub(super) fn weigh_appearance(
    objects: &mut [ObjectBelief],
    evidence: &Evidence<'_>,
    patches_max: usize,
) {
    let Some(touch) = evidence.touches.first() else { return };
    for_each_object(objects, evidence.maps, evidence.stop, |object, map| {
        let mut ratios = Vec::new();
        let n = patches_max.min(map.patches().len());
        touch.appearance_ratios(map.features(), 0..n, &mut ratios);
        object.log_evidence = f64::from((ratios.iter().sum::<f32>() / n as f32).ln());
    });
}
