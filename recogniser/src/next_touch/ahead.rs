//! Two presses ahead: what the best press after a press is expected to tell.
//!
//! One press can prepare another: where the pose decides what a place of the object tells, a press
//! that tells the pose makes the next one tell the object. For some truths drawn from the belief,
//! the belief after a first press is that of equation R26, and the best second press is the one
//! that equation R27 ranks first in it. Equation R27b of docs/recogniser.md.

use super::information::{Likeness, Shares};
use super::worth;

/// Number of first presses that are looked at.
pub(super) const FIRSTS: usize = 6;

/// Number of presses among which the second one is chosen.
pub(super) const SECONDS: usize = 12;

/// Number of truths that are drawn.
const TRUTHS: usize = 24;

/// Least share of a sample in a belief after a first press; smaller ones are left out.
const SHARE_MIN: f32 = 1e-4;

/// The expected worth of the best second press after each of the first [`FIRSTS`] of `presses`;
/// `None` if it should stop. All presses can be the second one.
pub(super) fn later_worths(
    presses: &[Likeness],
    belief: &Shares,
    should_stop: &mut dyn FnMut() -> bool,
) -> Option<Vec<f64>> {
    let truths = drawn(belief.shares());
    let mut worths = Vec::with_capacity(FIRSTS);
    for first in presses.iter().take(FIRSTS) {
        if should_stop() {
            return None;
        }
        let best_after = |truth: &usize| {
            let after = first.after(belief, *truth, SHARE_MIN);
            let second = presses.iter().map(|second| {
                worth(second.information(&after), second.contact_probability(&after), None)
            });
            second.fold(0.0, f64::max)
        };
        // Without samples there is no truth to draw.
        worths.push(truths.iter().map(best_after).sum::<f64>() / truths.len().max(1) as f64);
    }
    Some(worths)
}

/// Samples in proportion to their shares, at even distances in their sum.
fn drawn(shares: &[f32]) -> Vec<usize> {
    let step = shares.iter().sum::<f32>() / TRUTHS as f32;
    let mut truths = Vec::with_capacity(TRUTHS);
    let mut sum = 0.0;
    for (sample, share) in shares.iter().enumerate() {
        sum += share;
        while truths.len() < TRUTHS && (truths.len() as f32 + 0.5) * step < sum {
            truths.push(sample);
        }
    }
    truths
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use palpate_core::object::ObjectIdx;

    use super::super::footprint::ExpectedContact;
    use super::super::information::{Outcome, Scatter};
    use super::*;

    const SCATTER: Scatter = Scatter { position: 0.002_5, normal: 0.25, appearance: 4.0 };

    /// Contacts of two poses of one object and two of another, at these heights.
    fn outcomes(heights: [f32; 4]) -> Vec<Outcome> {
        let outcome = |(sample, z): (usize, f32)| {
            let met = ExpectedContact {
                contact: 1.0,
                position: Vec3::new(0.0, 0.0, z),
                normal: Vec3::Z,
                normal_deviation: 0.0,
                feature: [0; 8],
            };
            let object = ObjectIdx(sample as u32 / 2);
            Outcome { object, probability: 0.25, met: Some(met) }
        };
        heights.into_iter().enumerate().map(outcome).collect()
    }

    #[test]
    fn a_press_that_makes_the_next_one_tell_more_is_worth_more() {
        // The pose; the object if the pose is known; the object a little.
        let presses = [[0.0, 0.05, 0.0, 0.05], [0.0, 0.05, 0.05, 0.0], [0.0, 0.0, 0.005, 0.005]];
        let presses = presses.map(outcomes);
        let likenesses = presses.map(|press| Likeness::of(&press, 0.0, &SCATTER));
        let samples = [0, 0, 1, 1].map(|object| (ObjectIdx(object), 0.25));
        let belief = Shares::new(samples, 0.0);
        let bits = |press: &Likeness| press.information(&belief).identity;
        assert!(bits(&likenesses[0]) < 0.01 && bits(&likenesses[1]) < 0.01);
        // Two deviations apart: log2(2 / (1 + exp(−1/2))) = 0.316.
        assert!((bits(&likenesses[2]) - 0.316).abs() < 1e-3, "{}", bits(&likenesses[2]));
        let later = later_worths(&likenesses, &belief, &mut || false).unwrap();
        assert!(
            later[0] > 0.9 && later[1] > 0.9,
            "the other of the two tells the object: {later:?}"
        );
        assert!(later[2] < 0.4, "no press tells much after the third: {later:?}");
        assert_eq!(later_worths(&likenesses, &belief, &mut || true), None);
    }

    #[test]
    fn without_samples_no_press_is_worth_anything() {
        let (nothing, none) = (Likeness::of(&[], 0.0, &SCATTER), Shares::new([], 0.0));
        let worths = later_worths(&[nothing], &none, &mut || false).unwrap();
        assert!(worths.len() == 1 && worths[0].abs() < 1e-12, "{worths:?}");
    }

    #[test]
    fn truths_are_drawn_in_proportion_to_their_shares() {
        let truths = drawn(&[0.5, 0.0, 0.25, 0.25]);
        let n = |sample| truths.iter().filter(|it| **it == sample).count();
        assert_eq!([n(0), n(1), n(2), n(3)], [12, 0, 6, 6]);
    }
}
