//! Tests of equations 5.14 and 5.21–5.25 against hand-computed values.

use super::super::test_support::{map, one_turn, patch};
use super::*;
use crate::filter::sparse::{ProductRule, SparseHistogram};
use crate::sva::priors::MatchPriors;
use palpate_core::pose::Pose;

/// Stored weights are rounded to 65,535ths.
const ROUNDING: f64 = 1e-4;

/// Even priors, those of any map.
fn even(map: &ObjectMap) -> MatchWeights {
    MatchWeights::new(&[std::sync::Arc::new(map.clone())], MatchPriors::Even)
}

/// Total evidence for the map from an observed pair that is `distance_mm` long along x.
fn total(map: &ObjectMap, distance_mm: f64, classes: [&[(u8, f64)]; 2]) -> f64 {
    let a = patch([0.0; 3], classes[0]);
    let b = patch([distance_mm, 0.0, 0.0], classes[1]);
    let query = PairQuery::new(&a, &b).unwrap();
    find_poses(map, &query, &one_turn(), &even(map)).total()
}

#[test]
fn matches_are_weighted_by_the_share_of_their_distance_bin() {
    // Bins of 10 mm: 37.5 mm is spread over 32.5–42.5 mm, ¾ in bin 3 and ¼ in bin 4. One
    // stored pair is 34 mm long (bin 3), one 45 mm (bin 4), one 55 mm (bin 5, no share).
    let certain = |class: u8| vec![(class, 1.0)];
    let stored =
        |mm: f64| map(&[patch([0.0; 3], &certain(0)), patch([mm, 0.0, 0.0], &certain(1))], 10);
    let observed: [&[(u8, f64)]; 2] = [&certain(0), &certain(1)];
    let found = [34.0, 45.0, 55.0].map(|mm| total(&stored(mm), 37.5, observed));
    assert!((found[0] - 0.75).abs() < ROUNDING, "{found:?}");
    assert!((found[1] - 0.25).abs() < ROUNDING, "{found:?}");
    assert!(found[2].abs() < ROUNDING, "{found:?}");
}

#[test]
fn associations_of_query_and_map_multiply() {
    // One stored pair in the middle of its bin, so that the distance has the share 1. Stored:
    // a is of class 0 (0.8) or 1 (0.2), b of 2. Observed: a is of 0 (0.6) or 1 (0.4), b of 2
    // (0.7) or 3 (0.3). Classes that agree: (0, 2): 0.6·0.7·0.8 = 0.336; (1, 2):
    // 0.4·0.7·0.2 = 0.056; class 3 has no match. The sum is 0.392.
    let stored =
        map(&[patch([0.0; 3], &[(0, 0.8), (1, 0.2)]), patch([35.0, 0.0, 0.0], &[(2, 1.0)])], 10);
    let found = total(&stored, 35.0, [&[(0, 0.6), (1, 0.4)], &[(2, 0.7), (3, 0.3)]]);
    assert!((found - 0.392).abs() < ROUNDING, "{found}");
    // The reversed pair gives the same: it is stored once, under ordered classes.
    let turned = total(&stored, 35.0, [&[(2, 0.7), (3, 0.3)], &[(0, 0.6), (1, 0.4)]]);
    assert!((turned - 0.392).abs() < ROUNDING, "{turned}");
}

#[test]
fn two_patches_of_one_class_match_in_both_orders() {
    let stored = map(&[patch([0.0; 3], &[(0, 1.0)]), patch([35.0, 0.0, 0.0], &[(0, 0.5)])], 10);
    // 1 · 0.5 for each order.
    let found = total(&stored, 35.0, [&[(0, 1.0)], &[(0, 1.0)]]);
    assert!((found - 1.0).abs() < ROUNDING, "{found}");
}

#[test]
fn sampled_rotations_share_the_weight_of_their_match() {
    // Equation 5.34: a match of weight 0.5 contributes 0.5 for any number of sampled rotations.
    let stored = map(&[patch([0.0; 3], &[(0, 1.0)]), patch([35.0, 0.0, 0.0], &[(1, 0.5)])], 10);
    let (a, b) = (patch([0.0; 3], &[(0, 1.0)]), patch([35.0, 0.0, 0.0], &[(1, 1.0)]));
    let options = SvaOptions { sigma_init: 0.5, ..SvaOptions::literal() };
    let evidence = find_poses(&stored, &PairQuery::new(&a, &b).unwrap(), &options, &even(&stored));
    assert!((evidence.total() - 0.5).abs() < ROUNDING, "{}", evidence.total());
}

#[test]
fn a_match_gives_the_pose_that_aligns_it() {
    let pair = [patch([0.0; 3], &[(0, 1.0)]), patch([35.0, 0.0, 0.0], &[(1, 1.0)])];
    let stored = map(&pair, 10);
    let session_from_object =
        Pose::from_parts(glam::DQuat::from_rotation_z(1.0), glam::DVec3::new(0.101, 0.021, -0.043));
    let seen = pair.clone().map(|stored| Patch {
        position: session_from_object * stored.position,
        normal: session_from_object.turn(stored.normal),
        ..stored
    });
    let query = PairQuery::new(&seen[0], &seen[1]).unwrap();
    let options = one_turn();
    let evidence = find_poses(&stored, &query, &options, &even(&stored));
    let mut belief = SparseHistogram::new(ProductRule::Strict, 10);
    belief.multiply(&evidence, 1.0, 0.0, 1.0);
    let best = belief.best(10, 0.0);
    assert_eq!(best.len(), 1);
    assert!(best[0].0.abs() < ROUNDING); // ln of the whole weight of 1
    assert!(best[0].2.distance_to(&session_from_object) < 1e-6);
    assert!(best[0].2.angle_to(&session_from_object) < 1e-3);
}
