//! The search for poses: when pairs of touches propose, and which poses are refined and kept.

use super::answer::looks_like;
use super::evidence::Known;
use super::hypothesis::{Hypothesis, merge};
use super::motion::OBJECTS_MAX;
use super::partners::{Partner, in_turn, partners};
use super::propose::{Proposal, propose};
use super::sighting::Sighting;
use super::turned::Turned;
use super::{ObjectState, PairEvidence, SurfaceBelief, for_each_object};

/// Poses of less than this (ln) beside the best add nothing to its share.
const ALIKE_REACH: f32 = 8.0;

/// A pose more probable than this is likelier than not.
const LIKELY: f64 = 0.5;

/// Touches whose normal deviates by more (rad) propose nothing once there are poses that explain
/// the touches.
const UNSTEADY: f32 = 0.3;

impl SurfaceBelief {
    /// Proposes poses unless one object is certain and explains the touches well: of all that
    /// may be it, or of the likeliest few objects where another belief `leads`.
    pub(super) fn propose_in_doubt(&mut self, leads: bool) {
        let n = self.touches.len();
        let poor = self.is_poor();
        let share = self.share_of_best_pose();
        if !poor && n > 3 && share >= self.options.certain {
            return;
        }
        // What an unsteady touch proposes is little worth its cost; the next one will do.
        let newest = self.touches.last().map_or(0.0, |touch| touch.steadiness.normal_variance);
        if !poor && n > 3 && newest > UNSTEADY.powi(2) {
            return;
        }
        if !leads {
            self.propose_of_likeliest(OBJECTS_MAX, 1);
            return;
        }
        let budget = &self.options.budget;
        let n_partners = match (self.n_listed(), poor, share > LIKELY) {
            (_, false, true) => budget.partners_if_likely,
            (Some(_), _, _) => budget.many.partners,
            (None, true, _) => budget.partners_if_poor,
            (None, false, false) => budget.partners,
        };
        let partners = partners(&self.touches, n_partners);
        let shares = self.take_census(&partners, poor);
        let asked = in_turn(&partners, shares.as_deref(), n, &self.options);
        let reach = if poor { f64::INFINITY } else { f64::from(self.options.drop_between) };
        self.propose(&asked, reach, self.n_in_doubt(poor || share <= LIKELY));
    }

    /// Whether even the best hypothesis explains the touches poorly.
    pub(super) fn is_poor(&self) -> bool {
        let best = self.objects.iter().filter_map(|o| Some(o.hypotheses.first()?.score));
        let best = best.fold(f32::NEG_INFINITY, f32::max);
        f64::from(best) < f64::from(self.options.poor) * self.n_counted()
    }

    /// How many objects are listed for proposals: after the third touch some of them, and once a
    /// pose is likely fewer with every touch.
    fn n_in_doubt(&self, is_open: bool) -> Option<usize> {
        let n_touches = self.touches.len();
        let in_eight =
            if n_touches > 3 { self.options.budget.many.listed_later_in_eight } else { 8 };
        let shorter = |most: usize| most / n_touches.saturating_sub(2).max(1);
        let most = self.n_listed()? * in_eight / 8;
        Some(if is_open { most } else { shorter(most) })
    }

    /// The probability of the likeliest object in its likeliest pose, or in one that looks like
    /// it.
    fn share_of_best_pose(&self) -> f64 {
        let probabilities = self.own_probabilities();
        let shares = self.objects.iter().zip(&probabilities).enumerate();
        let Some((object, (state, p))) = shares.max_by(|a, b| a.1.1.total_cmp(b.1.1)) else {
            return 0.0;
        };
        let Some(best) = state.hypotheses.first() else { return 0.0 };
        let alike = state.hypotheses.iter().filter(|other| {
            other.score > best.score - ALIKE_REACH
                && looks_like(best, other, self.model.maps()[object].symmetry(), &self.options)
        });
        let share = |h: &Hypothesis| (f64::from(h.score) - state.log_evidence).exp();
        p * alike.map(share).sum::<f64>()
    }

    /// The newest touch and each partner propose poses of the objects that are at most
    /// `reach` (ln) less likely than the best, and of the `listed` ones that stand best, whether
    /// or not poses of theirs are known: those proposed before may all be wrong.
    pub(super) fn propose(&mut self, partners: &[Partner], reach: f64, listed: Option<usize>) {
        let budget = &self.options.budget;
        let standing = listed.map_or(f64::INFINITY, |n| self.standing_of(n));
        let n_objects = match self.n_listed() {
            Some(_) => budget.many.explored,
            None => budget.objects,
        };
        let (bar, refining) = match self.touches.len() {
            0..=2 if listed.is_some() => (f64::INFINITY, f64::INFINITY),
            0..=2 => (f64::NEG_INFINITY, f64::INFINITY),
            _ => (
                self.bar(reach, n_objects),
                self.bar(f64::from(self.options.drop_between), budget.refined_objects),
            ),
        };
        let is_large = listed.is_some();
        let hopeless = self.n_listed().map_or(f32::NEG_INFINITY, |_| self.hopeless());
        let (objects, evidence) = self.parts();
        let (touches, options) = (evidence.touches, evidence.options);
        let [earlier @ .., newest] = touches else { return };
        // The pair fits where it proposes: the others judge first.
        let others = |partner: usize| (0..earlier.len()).rev().filter(move |n| *n != partner);
        let judges = |partner: &Partner| -> Vec<&Sighting> {
            let others = others(partner.index).map(|n| &earlier[n]);
            others.chain([&earlier[partner.index], newest]).collect()
        };
        let judges: Vec<Vec<&Sighting>> = partners.iter().map(judges).collect();
        let Some(widest) = partners.iter().map(|p| p.effort).max_by_key(|e| e.patches) else {
            return;
        };
        for_each_object(objects, evidence.maps, evidence.stop, |state, map| {
            if state.log_evidence < bar && state.standing < standing {
                return;
            }
            let known = Known { map, carried: &state.carried };
            let looks_of_newest = widest.looks(map, newest);
            for (Partner { index, effort }, judges) in partners.iter().zip(&judges) {
                let pair = [newest, &earlier[*index]];
                let looks_of_partner = effort.looks(map, pair[1]);
                let looks = [&looks_of_newest[..looks_of_partner.len()], &looks_of_partner];
                let Some(mut proposed) = propose(map, pair, looks, *effort, options) else {
                    continue;
                };
                // Where the table was asked it has said of all objects how common the geometry is.
                let geometry = if is_large { state.pair.geometry } else { proposed.geometry };
                state.pair = PairEvidence {
                    geometry,
                    evidence: proposed.evidence,
                    looks: proposed.looks[0] * proposed.looks[1],
                };
                let others = &judges[..judges.len() - pair.len()];
                evidence.keep_best_by(others, &mut proposed.proposals, effort.judged, map);
                let mut new = Vec::with_capacity(proposed.proposals.len());
                let mut bar = hopeless;
                for Proposal { rotation, translation, .. } in proposed.proposals {
                    let pose = Turned::new(rotation, translation);
                    let judges = judges.iter().copied();
                    let Some(score) = evidence.score_in_turn(known, &pose, judges, bar) else {
                        continue;
                    };
                    bar = bar.max(score - options.drop_within);
                    new.push(Hypothesis { rotation, translation, score });
                }
                if touches.len() > 2 && state.log_evidence >= refining {
                    merge(&mut new, options);
                    new.truncate(options.budget.refined_proposals);
                    for hypothesis in &mut new {
                        evidence.settle(hypothesis, known);
                    }
                }
                state.hypotheses.extend(new);
            }
            merge(&mut state.hypotheses, options);
        });
    }

    /// The newest touch and some partners propose poses of the `n` likeliest objects.
    pub(super) fn propose_of_likeliest(&mut self, n: usize, n_partners: usize) {
        let partners = partners(&self.touches, n_partners);
        let reach = self.bar(f64::INFINITY, 1) - self.bar(f64::INFINITY, n);
        let asked = in_turn(&partners, None, self.touches.len(), &self.options);
        self.propose(&asked, reach, None);
    }

    /// Poses that score less are given up: some other object's best is that much better.
    fn hopeless(&self) -> f32 {
        let best = self.objects.iter().filter_map(|state| Some(state.hypotheses.first()?.score));
        best.fold(f32::NEG_INFINITY, f32::max) - self.options.drop_between
    }

    /// The least log-evidence of the `n` likeliest objects, at most `reach` below the best.
    fn bar(&self, reach: f64, n: usize) -> f64 {
        let mut logs: Vec<f64> = self.objects.iter().map(|state| state.log_evidence).collect();
        logs.sort_unstable_by(|a, b| b.total_cmp(a));
        let best = logs.first().copied().unwrap_or(f64::NEG_INFINITY);
        let last = logs.get(n.saturating_sub(1)).copied();
        last.unwrap_or(f64::NEG_INFINITY).max(best - reach)
    }

    /// Refines the best hypotheses of all objects, at most three each.
    pub(super) fn refine(&mut self) {
        let mut best: Vec<(f32, usize, usize)> = Vec::new();
        for (object, state) in self.objects.iter().enumerate() {
            let first = state.hypotheses.iter().take(3).enumerate();
            best.extend(first.map(|(index, hypothesis)| (hypothesis.score, object, index)));
        }
        best.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)).then(a.2.cmp(&b.2)));
        let top = best.first().map_or(0.0, |best| best.0);
        best.retain(|found| found.0 > top - self.options.drop_between);
        best.truncate(self.options.budget.refined);
        let (objects, evidence) = self.parts();
        for (_, object, index) in best {
            let ObjectState { hypotheses, carried, .. } = &mut objects[object];
            let known = Known { map: &evidence.maps[object], carried };
            evidence.settle(&mut hypotheses[index], known);
        }
        for state in objects {
            merge(&mut state.hypotheses, evidence.options);
        }
    }

    /// Keeps the hypotheses of all objects together within the budget.
    pub(super) fn bound(&mut self) {
        let total: usize = self.objects.iter().map(|state| state.hypotheses.len()).sum();
        if total <= self.options.budget.total {
            return;
        }
        let all = self.objects.iter().flat_map(|state| &state.hypotheses);
        let mut scores: Vec<f32> = all.map(|hypothesis| hypothesis.score).collect();
        scores.sort_unstable_by(|a, b| b.total_cmp(a));
        let bar = scores[self.options.budget.total];
        for state in &mut self.objects {
            state.hypotheses.retain(|hypothesis| hypothesis.score > bar);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::belief::SurfaceOptions;
    use crate::belief::options::{Budget, ManyBudget};
    use crate::belief::test_support::{belief_over, error, places, seen, single, some_pose};
    use crate::surface::Touch;
    use palpate_core::pose::Pose;

    /// A belief over `n` objects of 200 random places each, after `touches` of the first one,
    /// the newest of them pressed so evenly. Nothing was proposed yet.
    fn touched(n: u64, touches: usize, evenness: f64, options: SurfaceOptions) -> SurfaceBelief {
        let objects: Vec<Vec<Touch>> = (0..n).map(|index| places(200, index)).collect();
        let mut belief = belief_over(&objects, options);
        let newest = Touch { evenness, ..objects[0][20 * touches].clone() };
        let earlier = (1..touches).map(|touch| &objects[0][20 * touch]);
        belief.touches = earlier.chain([&newest]).map(|place| seen(place, &pose())).collect();
        belief.n_readings = touches;
        belief
    }

    fn pose() -> Pose {
        some_pose(5)
    }

    /// The first object is known to be at the true pose, as well as the evidence says.
    fn know(belief: &mut SurfaceBelief) {
        let (rotation, translation) = single(&pose());
        let (objects, evidence) = belief.parts();
        let known = Known { map: &evidence.maps[0], carried: &objects[0].carried };
        let at = Turned::new(rotation, translation);
        let score = evidence.score(known, &at, f32::NEG_INFINITY).unwrap();
        objects[0].hypotheses = vec![Hypothesis { rotation, translation, score }];
        belief.weigh();
    }

    /// Whether an object is known to be where it is; an ellipsoid looks alike after half a turn.
    fn is_found(state: &ObjectState) -> bool {
        let best = state.hypotheses.first();
        best.is_some_and(|h| error(h.rotation, h.translation, &pose()).0 < 0.003)
    }

    #[test]
    fn an_unsteady_touch_proposes_nothing_once_there_are_good_poses() {
        let after = |evenness, n_known| {
            let mut belief = touched(2, 4, evenness, SurfaceOptions::default());
            // A second object just like the first one, of which no pose is known yet.
            let first = belief.model.maps()[0].clone();
            belief.model = std::sync::Arc::new(belief.model.with_maps(vec![first.clone(), first]));
            if n_known > 0 {
                know(&mut belief);
            }
            belief.stage = 3;
            belief.objects[1].log_evidence = belief.objects[0].log_evidence;
            belief.propose_in_doubt(true);
            is_found(&belief.objects[1])
        };
        assert!(after(1.0, 1), "two objects are as likely");
        assert!(!after(0.2, 1), "the next touch will do");
        assert!(after(0.2, 0), "there is nothing else to go by");
    }

    #[test]
    fn an_object_whose_poses_are_all_wrong_is_proposed_of_again_if_it_stands_well() {
        let options = SurfaceOptions::default();
        // Lists of seven of 40 objects, by their standing alone.
        let mut budget = options.budget;
        (budget.many.listed_per_root, budget.many.explored) = (1, 0);
        budget.many.listed_later_in_eight = 8;
        // All places look alike: who looks likeliest says nothing.
        budget.many.fitted = usize::MAX;
        let after = |standing: f64| {
            let mut belief = touched(40, 4, 1.0, SurfaceOptions { budget, ..options });
            let (rotation, translation) = single(&some_pose(6));
            for (index, state) in belief.objects.iter_mut().enumerate() {
                state.hypotheses = vec![Hypothesis { rotation, translation, score: -20.0 }];
                state.standing = if index == 0 { standing } else { -(index as f64) };
                // Others are likelier: what is asked by its evidence is not this one.
                state.log_evidence = if index == 0 { -20.0 } else { -10.0 };
            }
            belief.stage = 3;
            let asked = in_turn(&[0, 1], Some(&[0.01; 2]), 4, &belief.options);
            belief.propose(&asked, 0.0, belief.n_in_doubt(true));
            is_found(&belief.objects[0])
        };
        assert!(after(-6.5), "the seventh");
        assert!(!after(-7.5), "the eighth");
    }

    #[test]
    fn of_many_objects_so_many_partners_and_judged_poses_and_pairs_are_looked_at() {
        let options = SurfaceOptions::default();
        let looked_at = |many: ManyBudget| {
            let budget = Budget { many, ..options.budget };
            let mut belief = touched(40, 4, 1.0, SurfaceOptions { budget, ..options });
            belief.propose_in_doubt(true);
            let posed = belief.objects.iter().map(|state| state.hypotheses.len());
            (posed.clone().max(), posed.sum::<usize>())
        };
        let all = usize::MAX;
        let all = ManyBudget { visited: all, visited_in_all: all, ..options.budget.many };
        // Each partner proposes, and of each as many stay as are judged.
        let one = ManyBudget { partners: 1, ..all };
        assert_eq!(looked_at(ManyBudget { judged: 1, ..one }).0, Some(1));
        let three = ManyBudget { partners: 3, judged: 1, ..all };
        assert!((2..=3).contains(&looked_at(three).0.unwrap()));
        assert_eq!(looked_at(ManyBudget { visited_in_all: 0, ..three }).0, Some(1), "the rarest");
        assert_eq!(looked_at(ManyBudget { judged: 2, ..one }).0, Some(2));
        let few = looked_at(ManyBudget { judged: 2, visited: 2, ..one }).1;
        let every = looked_at(ManyBudget { judged: 2, ..one }).1;
        assert!(2 * few < every, "{few} of {every}");
    }

    #[test]
    fn the_list_gets_shorter_only_once_a_pose_is_likely() {
        let listed = |touches: usize, is_open| {
            touched(40, touches, 1.0, SurfaceOptions::default()).n_in_doubt(is_open)
        };
        // All forty, sixteen times the root of 40 is more; then half.
        assert_eq!([3, 5, 7].map(|touches| listed(touches, true)), [40, 20, 20].map(Some));
        assert_eq!([3, 5, 7].map(|touches| listed(touches, false)), [40, 6, 4].map(Some));
        let few = touched(20, 3, 1.0, SurfaceOptions::default());
        assert_eq!(few.n_in_doubt(true), None, "so few objects are all asked");
    }
}
