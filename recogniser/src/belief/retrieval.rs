//! Candidates in a large catalogue: retrieval scores add up from lookup to lookup.

use super::object::{ObjectBelief, n_searched};
use crate::model::SurfaceModel;
use crate::observe::observation::Observation;
use crate::options::{Budget, SurfaceOptions};
use crate::propose::retrieval::{estimate, gains, mean_of};

/// Number of eighths in a full list of candidates.
const EIGHTHS: usize = 8;

/// Looks the newest touch up with each partner and updates the retrieval scores of all objects
/// that are not ruled out, however far they are behind: an object that is behind after two touches
/// may lead after four. Returns for each partner the share of an object's pairs with about the
/// observed geometry (catalogue mean); `None` when there is no newest touch, and in a small
/// catalogue.
///
/// Equation R19 of docs/recogniser.md.
pub(super) fn retrieve(
    objects: &mut [ObjectBelief],
    model: &SurfaceModel,
    touches: &[Observation],
    partners: &[usize],
    options: &SurfaceOptions,
) -> Option<Vec<f32>> {
    let [earlier @ .., newest] = touches else { return None };
    let joint = model.joint_pairs()?;
    let wanted: Vec<bool> = objects.iter().map(|object| !object.is_ruled_out).collect();
    let partners: Vec<&Observation> = partners.iter().map(|n| &earlier[*n]).collect();
    let n_searched = n_searched(objects).max(1);
    let mut shares = Vec::with_capacity(partners.len());
    for estimates in estimate(joint, newest, &partners, &wanted, options) {
        shares.push(mean_of(&estimates, n_searched, |estimate| estimate.geometry));
        let Some(gains) = gains(&estimates, options.retrieval_floor) else { continue };
        for ((object, estimate), gain) in objects.iter_mut().zip(&estimates).zip(gains) {
            let (Some(estimate), Some(gain)) = (estimate, gain) else { continue };
            object.retrieval_score += f64::from(newest.novelty) * gain;
            if object.pair.appearance <= 0.0 {
                object.pair = *estimate;
            }
        }
    }
    Some(shares)
}

/// Begins the retrieval scores with the priors of the objects (ln), relative to the likeliest one's,
/// so that an object that a camera names or that led before a move is a candidate. Equation R19 of
/// docs/recogniser.md.
pub(super) fn begin_scores(objects: &mut [ObjectBelief], log_priors: &[f64]) {
    let most = log_priors.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    for (object, log_prior) in objects.iter_mut().zip(log_priors) {
        if !object.is_ruled_out {
            object.retrieval_score = log_prior - most;
        }
    }
}

/// The least retrieval score of the `n` objects with the best.
pub(super) fn retrieval_bar(objects: &[ObjectBelief], n: usize) -> f64 {
    let mut all: Vec<f64> = objects.iter().map(|object| object.retrieval_score).collect();
    all.sort_unstable_by(|a, b| b.total_cmp(a));
    all.get(n.saturating_sub(1)).copied().unwrap_or(f64::NEG_INFINITY)
}

/// The number of candidates of `n` objects from the third touch on: half of them beyond three
/// places, and fewer with every place once a pose is likely (`is_open` is false).
pub(super) fn n_candidates(budget: &Budget, n: usize, n_places: usize, is_open: bool) -> usize {
    let eighths = if n_places > 3 { budget.many.listed_later_in_eight } else { EIGHTHS };
    let most = budget.n_listed(n) * eighths / EIGHTHS;
    if is_open { most } else { most / n_places.saturating_sub(2).max(1) }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use palpate_core::pose::Pose;

    use super::*;
    use crate::belief::common::Common;
    use crate::options::SurfaceOptions;
    use crate::test_support::{model_of, places, seen, some_pose};

    #[test]
    fn lists_get_shorter_only_once_a_pose_is_likely() {
        let budget = SurfaceOptions::default().budget;
        let listed = |n_places, is_open| n_candidates(&budget, 40, n_places, is_open);
        // All forty, sixteen times the root of 40 is more; then half.
        assert_eq!([3, 5, 7].map(|places| listed(places, true)), [40, 20, 20]);
        assert_eq!([3, 5, 7].map(|places| listed(places, false)), [40, 6, 4]);
    }

    #[test]
    fn objects_far_behind_are_looked_up_as_well() {
        let all: Vec<_> = (0..40).map(|index| places(60, index)).collect();
        let model = model_of(&all);
        let touches = [3, 50].map(|touch| seen(&all[30][touch], &some_pose(5)));
        let mut options = SurfaceOptions::default();
        // Lists of seven.
        options.budget.many.listed_per_root = 1;
        let object = |n| ObjectBelief { retrieval_score: -f64::from(n), ..ObjectBelief::new(0.0) };
        let mut objects: Vec<ObjectBelief> = (0..40).map(object).collect();
        objects[7] = ObjectBelief { retrieval_score: -7.0, ..ObjectBelief::new(f64::NEG_INFINITY) };
        let shares = retrieve(&mut objects, &model, &touches, &[0], &options).unwrap();
        assert!(shares.iter().all(|share| (1e-4..0.2).contains(share)), "{shares:?}");
        let gained = |n: usize| objects[n].retrieval_score + n as f64;
        assert!((0..40).all(|n| (gained(n).abs() > 1e-6) == (n != 7)), "all but the one ruled out");
        let sum: f64 = (0..40).map(gained).sum();
        assert!(sum.abs() < 1e-9 && gained(30) > 0.0, "{sum}");
    }

    #[test]
    fn objects_that_are_likely_before_the_touches_are_candidates() {
        let all: Vec<_> = (0..40).map(|index| places(60, index)).collect();
        let model = model_of(&all);
        let touches = [3, 50].map(|touch| seen(&all[30][touch], &some_pose(5)));
        let options = SurfaceOptions::default();
        let candidates = |prior: Option<&[f64]>| {
            let mut objects = Common::new(Arc::clone(&model), options, prior).unwrap().objects();
            retrieve(&mut objects, &model, &touches, &[0], &options).unwrap();
            let bar = retrieval_bar(&objects, 3);
            (0..40).filter(|n| objects[*n].retrieval_score >= bar).collect::<Vec<usize>>()
        };
        let told_nothing = candidates(None);
        let behind = (0..40).find(|n| !told_nothing.contains(n)).unwrap();
        let mut prior = [1e-6; 40];
        prior[behind] = 1.0;
        prior[told_nothing[0]] = 0.0;
        let told = candidates(Some(&prior));
        assert!(told.contains(&behind) && !told.contains(&told_nothing[0]), "{told:?}");
        assert_eq!(candidates(Some(&[0.5; 40])), told_nothing, "an even prior changes nothing");
    }

    #[test]
    fn a_touch_alone_is_not_looked_up() {
        let all: Vec<_> = (0..40).map(|index| places(20, index)).collect();
        let (model, options) = (model_of(&all), SurfaceOptions::default());
        let mut objects = vec![ObjectBelief::new(0.0); 40];
        let touch = seen(&all[0][0], &Pose::IDENTITY);
        let found = retrieve(&mut objects, &model, &[touch.clone(), touch], &[0], &options);
        // At one place: no pair, no gain.
        assert!(
            found.unwrap()[0].abs() < 1e-9
                && objects.iter().all(|o| o.retrieval_score.abs() < 1e-9)
        );
        assert_eq!(retrieve(&mut objects, &model, &[], &[], &options), None);
    }
}
