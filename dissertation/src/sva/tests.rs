//! Tests of equations 5.12–5.14 and the re-seeding of section 5.6.1 against hand-computed values.

use super::test_support::{catalogue, map, one_turn, patch};
use super::*;
use crate::filter::sparse::ProductRule;

/// Position of observed pairs, mm; the resulting pose is in the middle of its bin of 8 mm.
const SEEN: [f64; 3] = [4.0; 3];

/// A pair of classes 0 and 1, `mm` long along x, its first end at `from` (mm).
fn pair(from: [f64; 3], mm: f64) -> [Patch; 2] {
    let to = [from[0] + mm, from[1], from[2]];
    [patch(from, &[(0, 1.0)]), patch(to, &[(1, 1.0)])]
}

/// Two objects that hold the pair of 35 mm once: among 10 patches and among 20.
fn small_and_large() -> Arc<SvaModel> {
    let held = pair([0.0; 3], 35.0);
    catalogue(vec![map(&held, 10), map(&held, 20)])
}

fn belief(catalogue: &Arc<SvaModel>, options: SvaOptions) -> SvaBelief {
    SvaBelief::new(catalogue.clone(), options, None).unwrap()
}

fn multiply(belief: &mut SvaBelief, seen: &[Patch; 2]) {
    belief.multiply_pair(&seen[0], &seen[1]);
}

/// ln of the belief in an object's only bin, relative to the prior.
fn log_of_only_bin(belief: &SvaBelief, object: usize) -> f64 {
    let bins = belief.histograms[object].best(10, 0.0);
    assert_eq!(bins.len(), 1, "object {object}: {bins:?}");
    bins[0].0
}

#[test]
fn evidence_is_normalised_by_the_number_of_pairs() {
    // Equation 5.14: both objects have one match of weight 1, of 45 pairs and of 190. The
    // smaller one gets (1/45) / (1/45 + 1/190) = 190/235, the larger one 45/235.
    for options in [one_turn(), SvaOptions { sigma_init: 1e-6, ..SvaOptions::default() }] {
        let mut belief = belief(&small_and_large(), options);
        multiply(&mut belief, &pair(SEEN, 35.0));
        // Evidence of the two bins over the prior of 1 / (2 N), N the number of bins.
        let of_two = options.bins.log_count() + 2.0_f64.ln();
        let share = |object: usize| {
            let ratio = log_of_only_bin(&belief, object).exp();
            match options.rule {
                // once or, in both orders, squared
                ProductRule::Strict => ratio.sqrt() * (-of_two).exp(),
                // 1 + (1 − floor)/floor · share/prior
                ProductRule::Floored { floor } => {
                    (ratio - 1.0) * floor / (1.0 - floor) * (-of_two).exp()
                }
            }
        };
        assert!((share(0) - 190.0 / 235.0).abs() < 1e-4, "{}", share(0));
        assert!((share(1) - 45.0 / 235.0).abs() < 1e-4, "{}", share(1));
    }
}

#[test]
fn both_orders_of_a_pair_square_its_evidence() {
    let seen = pair(SEEN, 35.0);
    let log = |pair_weight: PairWeight| {
        let mut belief = belief(&small_and_large(), SvaOptions { pair_weight, ..one_turn() });
        multiply(&mut belief, &seen);
        log_of_only_bin(&belief, 0)
    };
    // Equation 5.14: share / prior = 190/235 · 2 N.
    let once = (190.0_f64 / 235.0).ln() + 2.0_f64.ln() + one_turn().bins.log_count();
    assert!((log(PairWeight::Once) - once).abs() < 1e-3);
    assert!((log(PairWeight::BothOrders) - 2.0 * once).abs() < 1e-3);
}

#[test]
fn all_pairs_of_a_new_reading_count_equally() {
    // Two pairs with one pose: the second counts as much as the first.
    let mut belief = belief(&small_and_large(), one_turn());
    multiply(&mut belief, &pair(SEEN, 35.0));
    let after_one = log_of_only_bin(&belief, 0);
    multiply(&mut belief, &pair(SEEN, 35.0));
    assert!((log_of_only_bin(&belief, 0) - 2.0 * after_one).abs() < 1e-3);
}

#[test]
fn a_pair_that_matches_nowhere_changes_nothing() {
    let mut belief = belief(&small_and_large(), one_turn());
    multiply(&mut belief, &pair(SEEN, 35.0));
    let before = log_of_only_bin(&belief, 0);
    multiply(&mut belief, &pair(SEEN, 85.0));
    assert!((log_of_only_bin(&belief, 0) - before).abs() < 1e-9);
}

#[test]
fn a_belief_without_poses_restarts_with_the_last_pair() {
    // Section 5.6.1. The second pair is the same one observed 100 mm away: no pose explains both.
    let mut contradicted = belief(&small_and_large(), one_turn());
    multiply(&mut contradicted, &pair(SEEN, 35.0));
    multiply(&mut contradicted, &pair([4.0, 104.0, 4.0], 35.0));
    let mut fresh = belief(&small_and_large(), one_turn());
    multiply(&mut fresh, &pair([4.0, 104.0, 4.0], 35.0));
    for object in 0..2 {
        let logs = [&contradicted, &fresh].map(|belief| log_of_only_bin(belief, object));
        assert!((logs[0] - logs[1]).abs() < 1e-9, "{logs:?}");
    }
    let answers = [&contradicted, &fresh].map(|belief| belief.answer(1));
    let poses = answers.map(|answer| answer.modes[0].session_from_object);
    assert!(poses[0].distance_to(&poses[1]) < 1e-9 && poses[0].translation.y > 0.09);
}

#[test]
fn one_object_without_poses_stays_impossible() {
    // Only the first object holds a pair of 55 mm, beside the one of 35 mm that both hold.
    let held = pair([0.0; 3], 35.0);
    let mut more = held.to_vec();
    more.push(patch([55.0, 0.0, 0.0], &[(2, 1.0)]));
    let mut belief = belief(&catalogue(vec![map(&more, 10), map(&held, 10)]), one_turn());
    multiply(&mut belief, &pair(SEEN, 35.0));
    let after_one = log_of_only_bin(&belief, 0);
    let [x, y, z] = SEEN;
    multiply(&mut belief, &[patch(SEEN, &[(0, 1.0)]), patch([x + 55.0, y, z], &[(2, 1.0)])]);
    assert!(!belief.histograms[0].is_impossible() && belief.histograms[1].is_impossible());
    // The first pair belongs to both objects, the second to the first alone: squared in both
    // orders, 2 ln(½ · 2 N) and 2 ln(2 N).
    let of_two = one_turn().bins.log_count() + 2.0_f64.ln();
    assert!((after_one - 2.0 * (of_two - 2.0_f64.ln())).abs() < 1e-3);
    assert!((log_of_only_bin(&belief, 0) - after_one - 2.0 * of_two).abs() < 1e-3);
    let answer = belief.answer(1);
    assert!((answer.probabilities[0] - 1.0).abs() < 1e-9, "{:?}", answer.probabilities);
}

#[test]
fn readings_pair_with_all_or_evenly_chosen_earlier_ones() {
    assert_eq!(partners(4, 16), [0, 1, 2, 3]);
    // 0, 10/4, 20/4 and 30/4, rounded down.
    assert_eq!(partners(10, 4), [0, 2, 5, 7]);
}
