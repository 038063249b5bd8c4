//! Self-match scores of a model's maps (equation R12), each computed when it is first needed.
//!
//! A score follows from the map, the appearance space and the width of the sensor, so that it
//! belongs to the model and not to the map, which models of other widths share.

use std::sync::OnceLock;

/// Number of kinds of touches: those that say everything, those without appearance, and those
/// with nothing but their position.
const KINDS: usize = 3;

/// The scores of all maps. They are derived, so models are compared without them.
#[derive(Debug)]
pub(super) struct SelfMatches(Vec<[OnceLock<f32>; KINDS]>);

impl SelfMatches {
    /// No score yet, of this many maps.
    pub(super) fn new(n_maps: usize) -> Self {
        Self(std::iter::repeat_with(Default::default).take(n_maps).collect())
    }

    /// The score of a map by touches of a kind, found by `find` on first use.
    pub(super) fn score(&self, map: usize, kind: usize, find: impl FnOnce() -> f32) -> f32 {
        *self.0[map][kind].get_or_init(find)
    }
}

impl PartialEq for SelfMatches {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}
