//! The evidence of one object on a given map and from given poses, to find out why a session
//! names a wrong object.
//!
//! A search that starts at the true pose cannot lose it, and a finer map loses less than the
//! catalogue's own. Experiments compare the results; no answer depends on them.

use palpate_core::log_prob::log_sum_exp;
use palpate_core::object::ObjectIdx;
use palpate_core::pose::Pose;

use super::SurfaceBelief;
use crate::belief::common::Common;
use crate::belief::object::n_searched;
use crate::belief::pair_weight::{pair_evidence, usual_density};
use crate::belief::posterior::{Explained, log_posterior};
use crate::belief::retrieval::{n_candidates, retrieval_bar};
use crate::belief::stage::Stage;
use crate::model::SurfaceMap;
use crate::observe::observation::Observation;
use crate::propose::effort::Effort;
use crate::propose::proposals::propose;
use crate::refine::merge::merge;
use crate::refine::settle::settle;
use crate::verify::evidence::{Evidence, Known};
use crate::verify::hypothesis::Hypothesis;

impl SurfaceBelief {
    /// ln L_o of each object by the search (equation R17), in the order of the catalogue.
    #[must_use]
    pub fn log_evidence(&self) -> Vec<f64> {
        let objects = self.leading().explained().objects;
        objects.iter().map(|object| object.log_evidence).collect()
    }

    /// ln L_o of an object (equation R17) if `map` were its surface, in the frame of its own map.
    ///
    /// From the third touch on it is the sum over the poses that the search has left and over
    /// `started` ones (`session_from_object`), each scored on `map`, refined, and kept as it
    /// was where refinement loses. After two touches it is the density of all tabled pairs of
    /// `map`, which needs no pose. `None` before that.
    #[must_use]
    pub fn log_evidence_on(
        &self,
        object: ObjectIdx,
        map: &SurfaceMap,
        started: &[Pose],
    ) -> Option<f64> {
        let of = self.leading().explained();
        match (of.stage, of.touches) {
            (Stage::Pair, [first, second]) => pair_on(&self.common, &of, map, [second, first]),
            (Stage::Poses, _) => {
                let belief = of.objects.get(object.0 as usize)?;
                let posed = |pose: &Pose| {
                    let translation = (pose.translation - self.anchor).as_vec3();
                    Hypothesis::new(pose.rotation.as_quat(), translation, 0.0)
                };
                let known = Known { map, prior: &belief.motion_prior };
                let found = belief.hypotheses.iter().copied();
                let all: Vec<Hypothesis> = found.chain(started.iter().map(posed)).collect();
                let spaces = self.leading().spaces();
                let evidence = self.common.evidence(of.touches, spaces);
                Some(poses_on(&self.common, &evidence, known, all))
            }
            _ => None,
        }
    }

    /// ln odds of an object against "none of these" (equation R18) by the likeliest motion of the
    /// object, if its evidence (ln L_o) were `log_evidence`.
    #[must_use]
    pub fn log_odds_with(&self, object: ObjectIdx, log_evidence: f64) -> f64 {
        let of = self.leading().explained();
        let (index, mut objects) = (object.0 as usize, of.objects.to_vec());
        objects[index].log_evidence = log_evidence;
        let logs = log_posterior(&self.common, &Explained { objects: &objects, ..of });
        logs[index] - logs[objects.len()]
    }

    /// Whether the object is a candidate by its retrieval score (equation R19) while no pose is
    /// likely; `None` in a small catalogue and before the second touch.
    #[must_use]
    pub fn is_candidate(&self, object: ObjectIdx) -> Option<bool> {
        let Explained { touches, objects, .. } = self.leading().explained();
        if !self.common.model.is_large() || touches.len() < 2 {
            return None;
        }
        let (budget, n) = (&self.common.options.budget, n_searched(objects));
        let n_listed = match touches.len() {
            2 => budget.n_listed(n).min(budget.many.listed_for_pair),
            later => n_candidates(budget, n, later, true),
        };
        let score = objects.get(object.0 as usize)?.retrieval_score;
        Some(score >= retrieval_bar(objects, n_listed))
    }

    /// Whether a pose of an object that the search has left lies within `distance` (m) and
    /// `angle` (rad) of `session_from_object`.
    #[must_use]
    pub fn has_pose_near(
        &self,
        object: ObjectIdx,
        session_from_object: &Pose,
        distance: f64,
        angle: f64,
    ) -> bool {
        let of = self.leading().explained();
        let Some(belief) = of.objects.get(object.0 as usize) else { return false };
        belief.hypotheses.iter().any(|hypothesis| {
            let pose = hypothesis.session_from_object(self.anchor);
            pose.distance_to(session_from_object) <= distance
                && pose.angle_to(session_from_object) <= angle
        })
    }
}

/// The evidence of two touches by all pairs of a map.
fn pair_on(
    common: &Common,
    of: &Explained<'_>,
    map: &SurfaceMap,
    touches: [&Observation; 2],
) -> Option<f64> {
    let options = &common.options;
    let share = common.model.is_large().then_some(0.0);
    let effort = Effort::new(options, share, touches.len());
    let ratios = touches.map(|touch| effort.appearance_ratios(map, touch));
    let proposed = propose(map, touches, [&ratios[0], &ratios[1]], effort, options)?;
    Some(pair_evidence(&proposed.pair, usual_density(of.objects)))
}

/// The evidence of three and more touches by these poses.
fn poses_on(
    common: &Common,
    evidence: &Evidence<'_>,
    known: Known<'_>,
    mut hypotheses: Vec<Hypothesis>,
) -> f64 {
    let score = |pose: &Hypothesis| evidence.score(known, &pose.inverse_pose(), f32::NEG_INFINITY);
    for hypothesis in &mut hypotheses {
        hypothesis.score = score(hypothesis).unwrap_or(f32::NEG_INFINITY);
        let before = *hypothesis;
        settle(evidence, hypothesis, known);
        if hypothesis.score < before.score {
            *hypothesis = before;
        }
    }
    merge(&mut hypotheses, &common.options);
    let lost = |touch| f64::from(common.kernel.floor_of(touch));
    let floor: f64 = evidence.touches.iter().map(lost).sum();
    log_sum_exp(hypotheses.iter().map(|h| f64::from(h.score)).chain([floor]))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::belief::component::Observed;
    use crate::belief::places::Places;
    use crate::observe::observation::Observation;
    use crate::options::SurfaceOptions;
    use crate::test_support::{map_of, model_of, places, seen, some_pose};

    /// A belief after `n` touches of the first of two objects, which lies at `some_pose(5)`.
    fn touched(n: usize) -> SurfaceBelief {
        let model = model_of(&[places(200, 0), places(200, 1)]);
        let mut belief = SurfaceBelief::new(model, SurfaceOptions::default(), None).unwrap();
        for place in places(n, 2) {
            let touch: Observation = seen(&place, &some_pose(5));
            let touch = touch.weighed(belief.rest.explained().touches, None);
            let observed = Observed { touch: Some(touch), spaces: Vec::new() };
            belief.rest.add(&belief.common, &observed, true);
        }
        belief
    }

    #[test]
    fn the_true_pose_adds_what_the_search_did_not_find() {
        let mut belief = touched(4);
        let map = Arc::clone(&belief.model().maps()[0]);
        let found = belief.log_evidence_on(ObjectIdx(0), &map, &[]).unwrap();
        assert!(belief.has_pose_near(ObjectIdx(0), &some_pose(5), 0.01, 0.4));
        assert!(found >= belief.log_evidence()[0] - 1e-3, "{found}");
        // Without any pose only the floor is left: 4 ln 0.01.
        let of = belief.rest.explained();
        let (stage, mut objects) = (of.stage, of.objects.to_vec());
        objects[0].hypotheses.clear();
        belief.rest.conclude(stage, objects, Places::default());
        let lost = belief.log_evidence_on(ObjectIdx(0), &map, &[]).unwrap();
        assert!((lost - 4.0 * 0.01f64.ln()).abs() < 1e-3, "{lost}");
        let started = belief.log_evidence_on(ObjectIdx(0), &map, &[some_pose(5)]).unwrap();
        assert!(started > 4.0 * 5.0, "{started}");
        assert!(!belief.has_pose_near(ObjectIdx(0), &some_pose(5), 0.01, 0.4), "none is left");
    }

    #[test]
    fn a_finer_map_of_the_surface_explains_the_touches_as_well() {
        let belief = touched(4);
        let on = |n: usize| {
            let map = map_of(&places(n, 3));
            belief.log_evidence_on(ObjectIdx(0), &map, &[some_pose(5)]).unwrap()
        };
        // The density is relative to the area, not to the number of patches: within 1 a touch.
        assert!((on(4_000) - on(500)).abs() < 4.0, "{} {}", on(4_000), on(500));
    }

    #[test]
    fn odds_follow_the_evidence_and_are_those_of_the_posterior() {
        let belief = touched(4);
        let (own, posterior) = (belief.log_evidence()[0], belief.posterior());
        let odds = |log| belief.log_odds_with(ObjectIdx(0), log);
        assert!((odds(own) - (posterior[0] / posterior[2]).ln()).abs() < 1e-6, "{posterior:?}");
        // No other object has evidence, so a nat more raises the odds by 1 / temperature.
        let temperature = belief.model().calibration.stages[2].temperature;
        assert!((odds(own + 1.0) - odds(own) - 1.0 / temperature).abs() < 0.05);
    }

    #[test]
    fn the_touched_object_is_a_candidate_of_a_large_catalogue() {
        assert_eq!(touched(3).is_candidate(ObjectIdx(0)), None, "two objects have no lists");
        let all: Vec<_> = (0..40).map(|index| places(60, index)).collect();
        let mut options = SurfaceOptions::default();
        options.budget.many.listed_per_root = 1;
        let mut belief = SurfaceBelief::new(model_of(&all), options, None).unwrap();
        for place in [3, 30, 50].map(|touch| &all[2][touch]) {
            let touch = Some(seen(place, &some_pose(5)));
            let observed = Observed { touch, spaces: Vec::new() };
            belief.rest.add(&belief.common, &observed, true);
        }
        let listed = (0..40).filter(|n| belief.is_candidate(ObjectIdx(*n)) == Some(true));
        let listed: Vec<u32> = listed.collect();
        assert!(listed.contains(&2) && listed.len() == 7, "{listed:?}");
    }

    #[test]
    fn two_touches_are_weighed_by_the_pairs_of_the_map() {
        let belief = touched(2);
        let map = &belief.model().maps()[0];
        let on_own = belief.log_evidence_on(ObjectIdx(0), map, &[]).unwrap();
        assert!((on_own - belief.log_evidence()[0]).abs() < 1e-4, "{on_own}");
        assert_eq!(touched(1).log_evidence_on(ObjectIdx(0), map, &[]), None);
    }
}
