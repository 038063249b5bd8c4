//! The evidence of pairs of touches, as far as the touches are of two places (equations R17, k = 2,
//! and R17a).

use super::Component;
use crate::belief::common::Common;
use crate::belief::object::{n_searched, searched};
use crate::belief::pair_weight::{density_anywhere, pair_evidence, usual_density};
use crate::belief::retrieval::retrieval_bar;
use crate::belief::search::Scope;
use crate::belief::stage::Stage;
use crate::propose::partners::in_turn;
use crate::propose::proposals::PairEvidence;

impl Component {
    /// The first pair proposes poses of all objects, or of the candidates. Returns whether it was
    /// looked up in the joint table.
    pub(super) fn propose_by_first_pair(&mut self, common: &Common) -> bool {
        let shares = self.retrieve(common, &[0]);
        let n = shares.as_ref().map(|_| {
            let budget = &common.options.budget;
            budget.n_listed(n_searched(&self.objects)).min(budget.many.listed_for_pair)
        });
        let asked = in_turn(&[0], shares.as_deref(), 2, &common.options);
        let least = n.map(|n| retrieval_bar(&self.objects, n));
        let scope = Scope::of_first_pair(&self.objects, least, &common.options);
        self.propose(common, &asked, &scope);
        shares.is_some()
    }

    /// Counts the place of the newest touch. Returns the share of its pair with the first touch
    /// among all pairs that may be of the only two places. Equation R17a of docs/recogniser.md.
    fn count_place(&mut self) -> Option<f64> {
        let [first, .., newest] = &self.touches[..] else { return None };
        self.places.add(newest.novelty.into(), newest.pairs_with(first).into())
    }

    /// The evidence of two touches, as far as they are of two places.
    pub(super) fn weigh_first_pair(&mut self, common: &Common) {
        if let Some(share) = self.count_place() {
            self.weigh_pair(common, share);
        }
    }

    /// The evidence of a later pair, as far as the touches before were of one place. Returns
    /// whether the pair of the first and the newest touch was looked up in the joint table.
    pub(super) fn weigh_another_pair(&mut self, common: &Common) -> bool {
        let Some(share) = self.count_place() else { return false };
        self.objects.iter_mut().for_each(|object| object.pair = PairEvidence::default());
        let asked = self.propose_by_first_pair(common);
        self.weigh_pair(common, share);
        self.weigh(common);
        asked
    }

    /// The evidence of the first and the newest touch: the density of stored pairs like theirs,
    /// which is more informative than any pose. Equation R17 of docs/recogniser.md, k = 2.
    pub(super) fn weigh_pair(&mut self, common: &Common, share: f64) {
        if self.objects.iter().all(|object| object.pair.appearance <= 0.0) {
            return;
        }
        self.stage = Stage::Pair;
        let usual = usual_density(&self.objects);
        for object in searched(&mut self.objects) {
            object.log_evidence = pair_evidence(&object.pair, usual);
        }
        if let [first, .., newest] = &self.touches[..] {
            let anywhere = density_anywhere([first, newest], &common.options);
            self.weigh_stated_pair(common, (f64::from(usual) / anywhere).max(1.0));
        }
        self.places.weigh_pair(share, &self.objects);
    }
}
