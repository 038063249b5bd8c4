//! The search for poses: which objects a pair proposes for, and which poses are refined and kept.

use super::object::{ObjectBelief, for_each_object};
use crate::observe::inverse_pose::InversePose;
use crate::observe::observation::Observation;
use crate::options::SurfaceOptions;
use crate::propose::partners::Partner;
use crate::propose::proposals::{PairEvidence, Proposal, propose};
use crate::refine::merge::merge;
use crate::refine::settle::settle;
use crate::verify::evidence::{Evidence, Known};
use crate::verify::hypothesis::Hypothesis;

/// Hypotheses of an object that are refined after a touch.
const REFINED_PER_OBJECT: usize = 3;

/// Selection of the objects that get proposals, and bounds on their poses.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scope {
    /// Least evidence (ln) of an object that gets proposals.
    evidence_min: f64,
    /// Least retrieval score of an object that gets proposals regardless of its evidence; `None`
    /// in a small catalogue.
    retrieval_min: Option<f64>,
    /// Least evidence (ln) of an object whose proposals are refined before they are merged.
    refined_min: f64,
    /// Least score of a pose; poses below it are far behind another object's best and are dropped.
    score_min: f32,
}

impl Scope {
    /// Scope after the second touch: the candidates, or all objects of a small catalogue.
    pub(super) fn of_first_pair(
        objects: &[ObjectBelief],
        retrieval_min: Option<f64>,
        options: &SurfaceOptions,
    ) -> Self {
        let is_large = retrieval_min.is_some();
        let evidence_min = if is_large { f64::INFINITY } else { f64::NEG_INFINITY };
        let score_min = score_min(objects, is_large, options);
        Self { evidence_min, retrieval_min, refined_min: f64::INFINITY, score_min }
    }

    /// Scope after later touches: the candidates, and the likeliest objects within `reach` (ln)
    /// of the best, including those with known poses, which may all be wrong.
    pub(super) fn in_doubt(
        objects: &[ObjectBelief],
        reach: f64,
        retrieval_min: Option<f64>,
        is_large: bool,
        options: &SurfaceOptions,
    ) -> Self {
        let budget = &options.budget;
        let n_objects = if is_large { budget.many.explored } else { usize::MAX };
        let between = f64::from(options.score.drop_between);
        Self {
            evidence_min: evidence_bar(objects, reach, n_objects),
            retrieval_min,
            refined_min: evidence_bar(objects, between, budget.refined_objects),
            score_min: score_min(objects, is_large, options),
        }
    }

    pub(super) fn has(&self, object: &ObjectBelief) -> bool {
        let is_candidate = self.retrieval_min.is_some_and(|least| object.retrieval_score >= least);
        object.log_evidence >= self.evidence_min || is_candidate
    }
}

/// The newest touch and each partner propose poses of the objects in scope; all touches judge
/// them.
pub(super) fn propose_poses(
    objects: &mut [ObjectBelief],
    evidence: &Evidence<'_>,
    partners: &[Partner],
    scope: &Scope,
) {
    let (touches, options) = (evidence.touches, evidence.options);
    let [earlier @ .., newest] = touches else { return };
    // A proposal fits its own pair by construction, so the other touches judge first.
    let others = |partner: usize| (0..earlier.len()).rev().filter(move |n| *n != partner);
    let judges = |partner: &Partner| -> Vec<&Observation> {
        let others = others(partner.index).map(|n| &earlier[n]);
        others.chain([&earlier[partner.index], newest]).collect()
    };
    let judges: Vec<Vec<&Observation>> = partners.iter().map(judges).collect();
    let Some(widest) = partners.iter().map(|p| p.effort).max_by_key(|e| e.patches) else {
        return;
    };
    for_each_object(objects, evidence.maps, evidence.stop, |object, map| {
        if !scope.has(object) {
            return;
        }
        let newest_ratios = widest.appearance_ratios(map, newest);
        for (Partner { index, effort }, judges) in partners.iter().zip(&judges) {
            let pair = [newest, &earlier[*index]];
            let partner_ratios = effort.appearance_ratios(map, pair[1]);
            let ratios = [&newest_ratios[..partner_ratios.len()], &partner_ratios];
            let Some(mut proposed) = propose(map, pair, ratios, *effort, options) else { continue };
            // The joint table already gave the geometry's frequency for all objects.
            let geometry = match scope.retrieval_min {
                Some(_) => object.pair.geometry,
                None => proposed.pair.geometry,
            };
            object.pair = PairEvidence { geometry, ..proposed.pair };
            let others = &judges[..judges.len() - pair.len()];
            evidence.keep_best_by(others, &mut proposed.proposals, effort.judged, map);
            let known = object.known(map);
            let mut new = judged(evidence, known, &proposed.proposals, judges, scope.score_min);
            if touches.len() > 2 && object.log_evidence >= scope.refined_min {
                merge(&mut new, options);
                new.truncate(options.budget.refined_proposals);
                new.iter_mut().for_each(|hypothesis| settle(evidence, hypothesis, known));
            }
            object.hypotheses.extend(new);
        }
        merge(&mut object.hypotheses, options);
    });
}

/// The proposals as hypotheses, scored by the `judges` in turn; poses far below the best of them or
/// below `bar` are left out.
pub(super) fn judged(
    evidence: &Evidence<'_>,
    object: Known<'_>,
    proposals: &[Proposal],
    judges: &[&Observation],
    mut bar: f32,
) -> Vec<Hypothesis> {
    let mut hypotheses = Vec::with_capacity(proposals.len());
    for Proposal { rotation, translation, .. } in proposals {
        let (rotation, translation) = (*rotation, *translation);
        let pose = InversePose::new(rotation, translation);
        let judges = judges.iter().copied();
        let Some(score) = evidence.score_in_turn(object, &pose, judges, bar) else { continue };
        bar = bar.max(score - evidence.options.score.drop_within);
        hypotheses.push(Hypothesis::new(rotation, translation, score));
    }
    hypotheses
}

/// Scores every hypothesis by all observations, applies `then` to it, and merges.
pub(super) fn score_anew(
    objects: &mut [ObjectBelief],
    evidence: &Evidence<'_>,
    then: impl Fn(&mut Hypothesis, Known<'_>) + Sync + Send,
) {
    for_each_object(objects, evidence.maps, evidence.stop, |object, map| {
        let ObjectBelief { hypotheses, motion_prior, .. } = object;
        let known = Known { map, prior: motion_prior };
        for hypothesis in &mut *hypotheses {
            let score = evidence.score(known, &hypothesis.inverse_pose(), f32::NEG_INFINITY);
            hypothesis.score = score.unwrap_or(f32::NEG_INFINITY);
            then(hypothesis, known);
        }
        merge(hypotheses, evidence.options);
    });
}

/// Adds `more` (ln) of each hypothesis to its score, and merges.
pub(super) fn add_scores(
    objects: &mut [ObjectBelief],
    evidence: &Evidence<'_>,
    more: impl Fn(Known<'_>, &InversePose) -> f32 + Sync + Send,
) {
    for_each_object(objects, evidence.maps, evidence.stop, |object, map| {
        let ObjectBelief { hypotheses, motion_prior, .. } = object;
        let known = Known { map, prior: motion_prior };
        for hypothesis in &mut *hypotheses {
            hypothesis.score += more(known, &hypothesis.inverse_pose());
        }
        merge(hypotheses, evidence.options);
    });
}

/// The best hypotheses of all objects, at most three each, which are refined after a touch: a bit
/// each, for every object.
pub(super) fn best_to_refine(objects: &[ObjectBelief], options: &SurfaceOptions) -> Vec<u8> {
    let mut best: Vec<(f32, usize, usize)> = Vec::new();
    for (object, belief) in objects.iter().enumerate() {
        let first = belief.hypotheses.iter().take(REFINED_PER_OBJECT).enumerate();
        best.extend(first.map(|(index, hypothesis)| (hypothesis.score, object, index)));
    }
    best.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)).then(a.2.cmp(&b.2)));
    let top = best.first().map_or(0.0, |best| best.0);
    best.retain(|found| found.0 > top - options.score.drop_between);
    best.truncate(options.budget.refined);
    let mut chosen = vec![0; objects.len()];
    for (_, object, index) in best {
        chosen[object] |= 1 << index;
    }
    chosen
}

/// Settles the chosen hypotheses of each object.
pub(super) fn settle_chosen(objects: &mut [ObjectBelief], evidence: &Evidence<'_>, chosen: &[u8]) {
    for ((object, map), chosen) in objects.iter_mut().zip(evidence.maps).zip(chosen) {
        let ObjectBelief { hypotheses, motion_prior, .. } = object;
        let known = Known { map, prior: motion_prior };
        let first = hypotheses.iter_mut().take(REFINED_PER_OBJECT).enumerate();
        for (_, hypothesis) in first.filter(|(index, _)| chosen & (1 << index) != 0) {
            settle(evidence, hypothesis, known);
        }
    }
}

/// Merges the hypotheses of all objects.
pub(super) fn merge_all(objects: &mut [ObjectBelief], options: &SurfaceOptions) {
    objects.iter_mut().for_each(|object| merge(&mut object.hypotheses, options));
}

/// Keeps at most `total` hypotheses of all objects together.
pub(super) fn bound(objects: &mut [ObjectBelief], total: usize) {
    let n: usize = objects.iter().map(|object| object.hypotheses.len()).sum();
    if n <= total {
        return;
    }
    let all = objects.iter().flat_map(|object| &object.hypotheses);
    let mut scores: Vec<f32> = all.map(|hypothesis| hypothesis.score).collect();
    scores.sort_unstable_by(|a, b| b.total_cmp(a));
    let bar = scores[total];
    for object in objects {
        object.hypotheses.retain(|hypothesis| hypothesis.score > bar);
    }
}

/// The score of the best hypothesis of all objects.
pub(super) fn best_score(objects: &[ObjectBelief]) -> f32 {
    objects.iter().filter_map(ObjectBelief::best_score).fold(f32::NEG_INFINITY, f32::max)
}

/// The score of the best hypothesis of all objects without what the session states about its pose:
/// how well it explains the touches.
pub(super) fn best_explanation(objects: &[ObjectBelief]) -> f32 {
    let first = |object: &ObjectBelief| object.best_score().unwrap_or(f32::NEG_INFINITY);
    let best = objects.iter().max_by(|a, b| first(a).total_cmp(&first(b)));
    let Some(best) = best else { return f32::NEG_INFINITY };
    let stated = |h: &Hypothesis| best.motion_prior.log_stated(&h.inverse_pose());
    first(best) - best.hypotheses.first().map_or(0.0, stated)
}

/// The least score of a pose worth keeping, beside other objects; none in a small catalogue.
fn score_min(objects: &[ObjectBelief], is_large: bool, options: &SurfaceOptions) -> f32 {
    if !is_large {
        return f32::NEG_INFINITY;
    }
    best_score(objects) - options.score.drop_between
}

/// The least log-evidence of the `n` likeliest objects, at most `reach` below the best.
pub(super) fn evidence_bar(objects: &[ObjectBelief], reach: f64, n: usize) -> f64 {
    let mut logs: Vec<f64> = objects.iter().map(|object| object.log_evidence).collect();
    logs.sort_unstable_by(|a, b| b.total_cmp(a));
    let best = logs.first().copied().unwrap_or(f64::NEG_INFINITY);
    let last = logs.get(n.saturating_sub(1)).copied();
    last.unwrap_or(f64::NEG_INFINITY).max(best - reach)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observe::touch::Touch;
    use crate::options::{Budget, ManyBudget};
    use crate::propose::effort::Effort;
    use crate::propose::partners::in_turn;
    use crate::test_support::{Session, error, inverse, places, seen, single, some_pose};
    use crate::verify::motion_prior::MotionPrior;

    /// Touches of the first of `n` objects of 200 random places each.
    fn touched(n: u64, touches: usize, options: SurfaceOptions) -> Session {
        let objects: Vec<Vec<Touch>> = (0..n).map(|index| places(200, index)).collect();
        let mut session = Session::over(&objects, options);
        let places = (1..=touches).map(|touch| &objects[0][20 * touch]);
        session.touches = places.map(|place| seen(place, &some_pose(5))).collect();
        session
    }

    /// Whether the best pose of an object is the true one, up to the half turns that map an
    /// ellipsoid onto itself.
    fn is_found(object: &ObjectBelief) -> bool {
        let best = object.hypotheses.first();
        best.is_some_and(|h| error(h.rotation, h.translation, &some_pose(5)).0 < 0.003)
    }

    #[test]
    fn a_candidate_gets_new_poses_although_its_own_are_wrong() {
        let mut options = SurfaceOptions::default();
        // Candidates by their retrieval score alone; all places have the same appearance.
        (options.budget.many.explored, options.budget.many.fitted) = (0, usize::MAX);
        let session = touched(40, 4, options);
        let after = |score: f64| {
            let (rotation, translation) = single(&some_pose(6));
            let object = |index: u32| ObjectBelief {
                hypotheses: vec![Hypothesis::new(rotation, translation, -20.0)],
                retrieval_score: if index == 0 { score } else { -f64::from(index) },
                // The others are likelier, so that the first is not explored.
                log_evidence: if index == 0 { -20.0 } else { -10.0 },
                ..ObjectBelief::default()
            };
            let mut objects: Vec<ObjectBelief> = (0..40).map(object).collect();
            let asked = in_turn(&[0, 1], Some(&[0.01; 2]), 4, &session.options);
            let scope = Scope::in_doubt(&objects, 0.0, Some(-7.0), true, &session.options);
            propose_poses(&mut objects, &session.evidence(), &asked, &scope);
            is_found(&objects[0])
        };
        assert!(after(-6.5) && !after(-7.5));
    }

    #[test]
    fn budgets_bound_partners_and_judged_poses_and_pairs() {
        let options = SurfaceOptions::default();
        let session = touched(40, 4, options);
        let proposed = |partners: &[usize], many: ManyBudget| {
            let options = SurfaceOptions { budget: Budget { many, ..options.budget }, ..options };
            let mut objects = vec![ObjectBelief::new(0.0); 40];
            let asked = in_turn(partners, Some(&vec![0.01; partners.len()]), 4, &options);
            let scope = Scope::in_doubt(&objects, 25.0, Some(0.0), true, &options);
            let evidence = Evidence { options: &options, ..session.evidence() };
            propose_poses(&mut objects, &evidence, &asked, &scope);
            let posed = objects.iter().map(|object| object.hypotheses.len());
            (posed.clone().max(), posed.sum::<usize>())
        };
        let all = usize::MAX;
        let all = ManyBudget { visited: all, visited_in_all: all, ..options.budget.many };
        let one = ManyBudget { judged: 1, ..all };
        assert_eq!(proposed(&[0], one).0, Some(1));
        assert!((2..=3).contains(&proposed(&[0, 1, 2], one).0.unwrap()));
        let rarest = ManyBudget { visited_in_all: 0, ..one };
        assert_eq!(proposed(&[0, 1, 2], rarest).0, Some(1));
        let two = ManyBudget { judged: 2, ..all };
        assert_eq!(proposed(&[0], two).0, Some(2));
        let few = proposed(&[0], ManyBudget { visited: 2, ..two }).1;
        let every = proposed(&[0], two).1;
        assert!(3 * few < 2 * every, "{few} of {every}");
    }

    #[test]
    fn the_first_pair_poses_candidates_and_all_of_a_small_catalogue() {
        let session = touched(3, 2, SurfaceOptions::default());
        let posed = |retrieval_min| {
            let object = |score| ObjectBelief { retrieval_score: score, ..ObjectBelief::new(0.0) };
            let mut objects = [1.0, 0.0, -1.0].map(object);
            let effort = Effort::new(&session.options, None, 2);
            let scope = Scope::of_first_pair(&objects, retrieval_min, &session.options);
            let partner = Partner { index: 0, effort };
            propose_poses(&mut objects, &session.evidence(), &[partner], &scope);
            objects.map(|object| !object.hypotheses.is_empty())
        };
        assert_eq!(posed(Some(0.5)), [true, false, false]);
        assert_eq!(posed(None), [true; 3]);
    }

    #[test]
    fn the_total_bounds_hypotheses_of_all_objects() {
        let hypothesis = |score: f32| {
            let (rotation, translation) = single(&some_pose(6));
            Hypothesis::new(rotation, translation, score)
        };
        let object = |scores: &[f32]| ObjectBelief {
            hypotheses: scores.iter().copied().map(hypothesis).collect(),
            ..ObjectBelief::default()
        };
        let mut objects = [object(&[5.0, 1.0]), object(&[4.0, 3.0, 2.0])];
        bound(&mut objects, 3);
        assert_eq!(objects.map(|object| object.hypotheses.len()), [1, 2]);
    }

    #[test]
    fn a_refined_pose_keeps_its_score_or_gains() {
        let session = touched(1, 4, SurfaceOptions::default());
        let evidence = session.evidence();
        let (rotation, translation) = single(&some_pose(5));
        let translation = translation + glam::Vec3::splat(0.001);
        let prior = MotionPrior::default();
        let known = Known { map: &evidence.maps[0], prior: &prior };
        let score =
            |h: &Hypothesis| evidence.score(known, &h.inverse_pose(), f32::NEG_INFINITY).unwrap();
        let mut start = Hypothesis::new(rotation, translation, 0.0);
        start.score = score(&start);
        let mut objects = [ObjectBelief { hypotheses: vec![start], ..ObjectBelief::new(0.0) }];
        let chosen = best_to_refine(&objects, evidence.options);
        settle_chosen(&mut objects, &evidence, &chosen);
        let refined = objects[0].hypotheses[0];
        assert!(refined.score > start.score && refined.score > 4.0 * 5.0, "{refined:?}");
        let exact = evidence.score(known, &inverse(&some_pose(5)), f32::NEG_INFINITY).unwrap();
        assert!((refined.score - exact).abs() < 3.0, "{refined:?} {exact}");
    }
}
