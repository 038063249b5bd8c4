//! Effort: bounds on the work for one pair of touches on one object.

use crate::model::SurfaceMap;
use crate::observe::observation::Observation;
use crate::options::{ManyBudget, SurfaceOptions};

/// Bounds on the work for one pair on one object.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Effort {
    /// Stored pairs that propose.
    pub(crate) proposals: usize,
    /// Proposals scored by all touches.
    pub(crate) judged: usize,
    /// Patches whose pairs are looked up: the first ones, which cover the surface evenly.
    pub(crate) patches: usize,
    /// Appearance-compatible pairs that get the geometric check, best first.
    pub(crate) fitted: usize,
    /// Least product of the two appearance ratios of a pair that proposes.
    pub(crate) appearance_min: f32,
}

impl Effort {
    /// The effort after this many touches. In a large catalogue `share` is the share of an
    /// object's pairs with about the observed geometry (catalogue mean), else `None`.
    ///
    /// Equation R20 of docs/recogniser.md.
    pub(crate) fn new(options: &SurfaceOptions, share: Option<f32>, n_touches: usize) -> Self {
        let (budget, all) = (&options.budget, usize::MAX);
        let Some(share) = share else {
            let (proposals, appearance_min) = (budget.proposals_per_object, options.appearance_min);
            return Self { proposals, judged: all, patches: all, fitted: all, appearance_min };
        };
        let ManyBudget { proposals, judged, paired, visited, fitted, .. } = budget.many;
        let appearance_min = options.appearance_min_if_many;
        // The density of pairs about the first two touches is evidence, so all are looked up.
        if n_touches <= 2 {
            return Self { proposals, judged, patches: all, fitted: all, appearance_min };
        }
        // n patches have about n² pairs.
        let patches = (visited as f32 / share.max(f32::MIN_POSITIVE)).sqrt() as usize;
        Self { proposals, judged, patches: patches.min(paired), fitted, appearance_min }
    }

    /// The number of the map's patches that are looked up, the first ones.
    pub(crate) fn n_patches(&self, map: &SurfaceMap) -> usize {
        map.layout().pair_patches_max.min(map.patches().len()).min(self.patches)
    }

    /// Appearance ratios of an observation at the patches that are looked up.
    pub(crate) fn appearance_ratios(
        &self,
        map: &SurfaceMap,
        observation: &Observation,
    ) -> Vec<f32> {
        let mut ratios = Vec::new();
        observation.appearance_ratios(map.features(), 0..self.n_patches(map), &mut ratios);
        ratios
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_large_catalogue_looks_up_fewer_pairs_from_touch_three() {
        let options = SurfaceOptions::default();
        let many = options.budget.many;
        let all = usize::MAX;
        for n_touches in [2, 3, 9] {
            let few = Effort::new(&options, None, n_touches);
            assert_eq!([few.patches, few.fitted, few.judged], [all; 3]);
            assert_eq!(few.proposals, options.budget.proposals_per_object);
        }
        let pair = Effort::new(&options, Some(0.5), 2);
        assert_eq!([pair.patches, pair.fitted], [all; 2], "however common");
        let after_three = |share| Effort::new(&options, share, 3);
        let rare = after_three(Some(0.001));
        assert_eq!((rare.patches, rare.fitted), (many.paired, many.fitted));
        assert_eq!((rare.proposals, rare.judged), (many.proposals, many.judged));
        assert_eq!(after_three(Some(0.0)).patches, many.paired);
        // 1,200 of 3 % are 40,000 pairs, of 200 patches.
        assert_eq!(after_three(Some(0.03)).patches, 200);
        assert!(many.proposals < options.budget.proposals_per_object);
        let least = |share| after_three(share).appearance_min;
        assert!(least(Some(0.01)) > least(None), "pairs have to look alike more");
    }
}
